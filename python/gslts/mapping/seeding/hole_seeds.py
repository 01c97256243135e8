"""First Gaussians where nothing was measured: too near, too shiny, beyond the depth's border."""

from __future__ import annotations

import numpy as np

from gslts.core.camera import Camera
from gslts.core.gaussian_map import FloatArray, GaussianMap
from gslts.core.se3 import transform
from gslts.mapping.seeding.depth_seeds import flat_gaussians
from gslts.rendering.rasterizer import Images
from gslts.types import Floats

HOLE_ALPHA = 0.4
"""A pixel with less is a hole."""
STRIDE = 4
"""One Gaussian for so many pixels each way."""
OPACITY = 0.5
SMOOTHINGS = 4
"""At each resolution, so that no steps of the coarser one are left."""


def seeds_in_holes(
    camera: Camera, images: Images, colors: FloatArray, measured: FloatArray, sh_degree: int
) -> GaussianMap | None:
    """Gaussians at a depth between those that are known around a hole.

    Args:
        camera: That was rendered, in a frame that starts at the map's origin.
        images: Of the map there.
        colors: [H,W,3] of the photograph, as the map would have to show them.
        measured: [H,W] depth, m; 0 where there is none.
        sh_degree: Of the map.

    Returns:
        Flat ones that face the camera, or None where the map has no holes.
    """
    alpha, rendered = _binned(images.alpha), _binned(images.depth)
    known = np.where((alpha >= HOLE_ALPHA) & (rendered > 0), rendered, 0)
    nearest = _binned(measured)
    known = np.where((known == 0) & (nearest > 0), nearest, known)
    holes = alpha < HOLE_ALPHA
    if not holes.any() or not known.any():
        return None
    depth = interpolated(known)[holes]
    rows, columns = np.nonzero(holes)
    u, v = ((index + 0.5) * STRIDE for index in (columns, rows))
    x, y = (u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy
    pose = camera.world_from_camera
    points = transform(pose, np.stack([x * depth, y * depth, depth], axis=1))
    towards = pose[:3, 3] - points
    shades = np.stack([_binned(colors[..., c])[holes] for c in range(3)], axis=1)
    return flat_gaussians(points, towards, shades, depth * STRIDE / camera.fx, OPACITY, sh_degree)


def interpolated(known: Floats) -> Floats:
    """[H,W] the image, its zeros filled smoothly from coarser and coarser means of the rest."""
    if known.all() or min(known.shape) < 2:
        return np.where(known > 0, known, known[known > 0].mean() if known.any() else 0)
    height, width = known.shape
    padded = np.pad(known, ((0, height % 2), (0, width % 2)))
    four = padded.reshape(padded.shape[0] // 2, 2, padded.shape[1] // 2, 2)
    count = (four > 0).sum(axis=(1, 3))
    coarse = interpolated(four.sum(axis=(1, 3)) / np.maximum(count, 1))
    filled = coarse.repeat(2, axis=0).repeat(2, axis=1)[:height, :width]
    for _ in range(SMOOTHINGS):
        around = np.pad(np.where(known > 0, known, filled), 1, mode="edge")
        filled = (around[:-2, 1:-1] + around[2:, 1:-1] + around[1:-1, :-2] + around[1:-1, 2:]) / 4
    return np.where(known > 0, known, filled)


def _binned(image: FloatArray) -> Floats:
    """Means of STRIDE x STRIDE pixels; what is left over at the end is cut off."""
    height, width = (length // STRIDE for length in image.shape)
    part = image[: height * STRIDE, : width * STRIDE].astype(np.float64)
    means: Floats = part.reshape(height, STRIDE, width, STRIDE).mean(axis=(1, 3))
    return means
