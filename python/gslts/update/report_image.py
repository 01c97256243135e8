"""Images that compare two versions of a map with each other, and with the observed frames."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gslts.core.camera import Camera
from gslts.core.gaussian_map import GaussianMap
from gslts.io.images import RgbImage, draw_text, to_rgb8
from gslts.rendering.losses import apply_exposure
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.rendering.view_range import view_range_m
from gslts.update.views import View

MAX_ROWS = 3
"""Maximum number of rows of an image."""
MAX_CAMERAS = 60
"""Maximum number of cameras that are rendered to find where two maps differ most."""
WHITE = (255, 255, 255)
"""Colour of the captions."""


def draw_update(
    before: GaussianMap, after: GaussianMap, views: Sequence[View], threads: int = 0
) -> RgbImage:
    """Draw the observed frame, the map before and the map after side by side.

    Args:
        before: float32.
        after: float32.
        views: At least one. Some of the size of the first one are drawn, evenly spaced.
        threads: 0 uses all hardware threads.

    Returns:
        [H,W,3] uint8 sRGB; one row per view.
    """
    rasterizer, maps = Rasterizer(np.float32), (before.without_features(), after.without_features())
    rows = []
    views = [view for view in views if view.frame.rgb.shape == views[0].frame.rgb.shape]
    for index in np.unique(np.linspace(0, len(views) - 1, MAX_ROWS).astype(int)):
        view = views[index]
        options = RenderOptions(far_m=view_range_m(view.depth), threads=threads)
        tiles = [view.frame.rgb.copy()]
        for gaussian_map in maps:
            rgb = rasterizer.forward(gaussian_map, view.camera, options).rgb
            tiles.append(to_rgb8(apply_exposure(rgb, view.exposure)))
        for tile, caption in zip(tiles, ("observed", "map before", "map after"), strict=True):
            draw_text(tile, caption, (8, 20), WHITE)
        rows.append(np.concatenate(tiles, axis=1))
    return np.concatenate(rows)


def draw_difference(
    before: GaussianMap, after: GaussianMap, cameras: Sequence[Camera], threads: int = 0
) -> RgbImage:
    """Draw both maps and their difference side by side, from the cameras that see most of it.

    Args:
        before: float32.
        after: float32.
        cameras: At least one.
        threads: 0 uses all hardware threads.

    Returns:
        [H,W,3] uint8 sRGB; one row per camera.

    Raises:
        ValueError: There is no camera.
    """
    if not cameras:
        raise ValueError("draw_difference: cameras: expected at least one, got none")
    rasterizer, options = Rasterizer(np.float32), RenderOptions(threads=threads)
    rows = []
    for camera in cameras[:: max(1, len(cameras) // MAX_CAMERAS)]:
        old, new = (rasterizer.forward(m, camera, options).rgb for m in (before, after))
        difference = np.abs(new - old).max(axis=2, keepdims=True).repeat(3, axis=2)
        row = np.concatenate([old, new, difference], axis=1)
        rows.append((float(difference.mean()), row))
    best = [row for _, row in sorted(rows, key=lambda pair: -pair[0])[:MAX_ROWS]]
    return np.concatenate([to_rgb8(row) for row in best if row.shape[1] == best[0].shape[1]])
