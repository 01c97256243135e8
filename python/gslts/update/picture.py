"""A picture of an update: what a robot saw, and the map before and after."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gslts.gaussian_map import GaussianMap
from gslts.losses import exposed
from gslts.pictures import Picture, picture_of, write_on
from gslts.render import Rasterizer, RenderOptions
from gslts.update.views import View

VIEWS = 3
"""Rows of the picture, at most."""
WHITE = (255, 255, 255)


def update_picture(
    before: GaussianMap, after: GaussianMap, views: Sequence[View], threads: int = 0
) -> Picture:
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
            tiles.append(picture_of(exposed(rgb, view.exposure)))
        for tile, words in zip(tiles, ("seen", "map before", "map after"), strict=True):
            write_on(tile, words, (8, 20), WHITE)
        rows.append(np.concatenate(tiles, axis=1))
    return np.concatenate(rows)
