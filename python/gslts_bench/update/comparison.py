"""Images that compare updates, for people to look at."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gslts.core.gaussian_map import GaussianMap
from gslts.io.images import RgbImage, draw_text, to_rgb8
from gslts_bench.update.score import Judge

ROWS = 2
"""Number of rows of near viewpoints, and of far ones."""


def compare(judge: Judge, maps: Mapping[str, GaussianMap]) -> RgbImage:
    """Put test images beside renderings of some maps, each in half its size.

    Args:
        judge: Judge whose first near and far viewpoints are shown.
        maps: Maps by name of the method.

    Returns:
        [H,W,3] 8-bit sRGB.
    """
    rows = []
    for near in (True, False):
        for view in [view for view in judge.views if view.near == near][:ROWS]:
            tiles = {"after the change": view.photo}
            tiles |= {name: judge.render(known, view, view.camera) for name, known in maps.items()}
            row = []
            for name, rgb in tiles.items():
                tile = np.ascontiguousarray(to_rgb8(rgb)[::2, ::2])
                draw_text(tile, name, (6, 16), (255, 255, 255))
                row.append(tile)
            rows.append(np.concatenate(row, axis=1))
    return np.concatenate(rows)
