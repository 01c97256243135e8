"""Points and boxes that a click on a page means."""

from __future__ import annotations

import numpy as np

from gslts.core.camera import Camera, look_at
from gslts.core.gaussian_map import GaussianMap
from gslts.core.se3 import inverse_transform
from gslts.rendering.rasterizer import RenderOptions, render
from gslts.store.causes import Box
from gslts.types import Floats

MIN_ALPHA = 0.5
"""Minimum opacity of what is clicked on."""
FOCAL_PX = 500.0
"""Focal length of the pixel that is rendered for a click, px: about that of a page."""
PICK_RADIUS_M = 0.03
"""Distance around a point on a surface in which Gaussians are taken to name it, and by which it may
lie outside of the box of its object, m: the noise of depth."""


def surface_point(gaussian_map: GaussianMap, eye: Floats, direction: Floats) -> Floats | None:
    """Find the surface of a map that a ray hits, by the depth of one pixel.

    Args:
        gaussian_map: The map.
        eye: (3,) start of the ray in the world, m; from a page, so anything.
        direction: (3,) direction, of any length.

    Returns:
        (3,) in the world, m; None if the ray hits nothing.
    """
    length = float(np.linalg.norm(direction))
    if not (np.isfinite(eye).all() and np.isfinite(length) and length > 0):
        return None
    forward = direction / length
    up = np.eye(3)[np.argmin(np.abs(forward))]  # Any direction but that of the ray.
    pixel = Camera(
        fx=FOCAL_PX,
        fy=FOCAL_PX,
        cx=0.5,
        cy=0.5,
        width=1,
        height=1,
        world_from_camera=look_at(eye, eye + forward, up),
    )
    images = render(gaussian_map, pixel, RenderOptions(threads=1))
    if images.alpha[0, 0] < MIN_ALPHA:
        return None
    point: Floats = eye + float(images.depth[0, 0]) * forward
    return point


def is_in_view(camera: Camera, point: Floats) -> bool:
    """Return whether a point lies in the image of a camera, whatever hides it.

    Args:
        camera: In the world.
        point: (3,) in the world, m.
    """
    x, y, z = inverse_transform(camera.world_from_camera, point[None])[0]
    if z <= 0:
        return False
    u, v = camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy
    return bool(0 <= u < camera.width and 0 <= v < camera.height)


def contains(box: Box | tuple[Floats, Floats], point: Floats) -> bool:
    """Return whether a point on a surface is of the object in a box.

    Args:
        box: Lower and upper corner, m.
        point: (3,) m.
    """
    low, high = np.array(box[0]) - PICK_RADIUS_M, np.array(box[1]) + PICK_RADIUS_M
    return bool(((low <= point) & (point <= high)).all())


def volume_m3(box: Box) -> float:
    """Return the volume of a box, m^3.

    Args:
        box: Lower and upper corner, m.
    """
    return float(np.prod(np.subtract(box[1], box[0])))
