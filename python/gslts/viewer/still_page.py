"""Page of images of a map, for browsers that cannot draw Gaussians."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from gslts.core.camera import Camera, camera_from_fov, downscale, look_at
from gslts.core.gaussian_map import GaussianMap
from gslts.io.data_urls import jpeg_of
from gslts.io.html_page import plots, section
from gslts.io.images import to_rgb8
from gslts.rendering.rasterizer import render
from gslts.store.camera_files import cameras_of_store
from gslts.store.history_page import make_history_page
from gslts.store.map_folder import open_map
from gslts.viewer.viewed_map import DEFAULT_FOV_RAD, outside_view

MAX_VIEWS = 6
"""Number of cameras of the map, evenly spread over their list, from which it is shown."""
MAX_WIDTH_PX = 640
"""Width of the images, px; those of larger cameras are reduced."""
HEIGHT_PX = 480
"""Height of the image of a map without cameras, px."""
TITLE = "This browser has no WebGL 2: the map in images"
"""Heading of the images."""


def make_still_page(folder: Path) -> bytes:
    """Make a page of the newest version, from some of its cameras or from outside, and the history.

    Args:
        folder: Folder of the map.

    Returns:
        HTML in UTF-8.

    Raises:
        OSError: The map cannot be read.
        ValueError: The map is damaged.
    """
    with open_map(folder) as store:
        gaussian_map = store.read()
        cameras = cameras_of_store(store) or {"outside": _outside_camera(gaussian_map)}
        step = max(1, -(-len(cameras) // MAX_VIEWS))
        shown = [(name, cameras[name]) for name in list(cameras)[::step]]
        views = _views(gaussian_map, shown)
        note = "<p>The images are those of now; load the page again for later versions.</p>"
        return make_history_page(store, sections=[section(TITLE, note + views)])


def _outside_camera(gaussian_map: GaussianMap) -> Camera:
    position, target = outside_view(gaussian_map)
    fov_x_rad = 2 * np.arctan(np.tan(DEFAULT_FOV_RAD / 2) * MAX_WIDTH_PX / HEIGHT_PX)
    origin = gaussian_map.origin
    return camera_from_fov(
        MAX_WIDTH_PX, HEIGHT_PX, fov_x_rad, look_at(origin + position, origin + target)
    )


def _views(gaussian_map: GaussianMap, cameras: Iterable[tuple[str, Camera]]) -> str:
    """Return images of a map from cameras with names."""
    images = []
    for name, camera in cameras:
        smaller = downscale(camera, -(-camera.width // MAX_WIDTH_PX))
        rgb = to_rgb8(render(gaussian_map, smaller).rgb)
        images.append((f"The map from {name}", jpeg_of(rgb)))
    return plots(*images)
