"""Pictures of two versions of a map, and of what a robot saw between them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gslts.core.camera import Camera
from gslts.core.gaussian_map import GaussianMap
from gslts.io.images import RgbImage, draw_text, to_rgb8
from gslts.rendering.losses import apply_exposure
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.update.views import View

VIEWS = 3
"""Rows of a picture, at most."""
LOOKED_AT = 60
"""Cameras that are tried for the difference of two maps, at most."""
WHITE = (255, 255, 255)


def update_picture(
    before: GaussianMap, after: GaussianMap, views: Sequence[View], threads: int = 0
) -> RgbImage:
    """The photograph, the map before and the map after, side by side; a row for each of some views.

    Args:
        before: float32.
        after: float32.
        views: At least one; some of those of the first one's size, spread evenly, are shown.
        threads: 0 means one a hardware thread.
    """
    rasterizer, options = Rasterizer(np.float32), RenderOptions(threads=threads)
    rows = []
    views = [view for view in views if view.frame.rgb.shape == views[0].frame.rgb.shape]
    for number in np.unique(np.linspace(0, len(views) - 1, VIEWS).astype(int)):
        view = views[number]
        tiles = [view.frame.rgb.copy()]
        for gaussian_map in (before, after):
            rgb = rasterizer.forward(gaussian_map, view.camera, options).rgb
            tiles.append(to_rgb8(apply_exposure(rgb, view.exposure)))
        for tile, words in zip(tiles, ("seen", "map before", "map after"), strict=True):
            draw_text(tile, words, (8, 20), WHITE)
        rows.append(np.concatenate(tiles, axis=1))
    return np.concatenate(rows)


def difference_picture(
    before: GaussianMap, after: GaussianMap, cameras: Sequence[Camera], threads: int = 0
) -> RgbImage:
    """Both maps and where they differ, side by side, from the cameras that see most of it.

    Args:
        before: float32.
        after: float32.
        cameras: At least one.
        threads: 0 means one a hardware thread.

    Raises:
        ValueError: There is no camera.
    """
    if not cameras:
        raise ValueError("difference_picture: there is no camera to look from")
    rasterizer, options = Rasterizer(np.float32), RenderOptions(threads=threads)
    rows = []
    step = max(1, len(cameras) // LOOKED_AT)
    for camera in cameras[::step]:
        was, is_ = (rasterizer.forward(one, camera, options).rgb for one in (before, after))
        apart = np.abs(is_ - was).max(axis=2, keepdims=True).repeat(3, axis=2)
        rows.append((float(apart.mean()), np.concatenate([was, is_, apart], axis=1)))
    best = sorted(rows, key=lambda row: -row[0])[:VIEWS]
    width = best[0][1].shape[1]
    return np.concatenate([to_rgb8(one) for _, one in best if one.shape[1] == width])
