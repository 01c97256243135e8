"""Pictures of updates, for people to look at."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gslts.core.gaussian_map import GaussianMap
from gslts.io.images import RgbImage, draw_text, to_rgb8
from gslts_bench.update.score import Judge

ROWS = 2
"""Of near views, and of far ones."""
WHITE = (255, 255, 255)


def compared(judge: Judge, maps: Mapping[str, GaussianMap]) -> RgbImage:
    """Test views beside what some maps show there, each in half its size.

    Args:
        judge: Whose first near and far views are shown.
        maps: By name of the method.
    """
    rows = []
    for near in (True, False):
        for view in [one for one in judge.views if one.near == near][:ROWS]:
            tiles = {"after the change": view.photo}
            tiles |= {name: judge.shown(one, view, view.camera) for name, one in maps.items()}
            row = []
            for name, rgb in tiles.items():
                tile = np.ascontiguousarray(to_rgb8(rgb)[::2, ::2])
                draw_text(tile, name, (6, 16), WHITE)
                row.append(tile)
            rows.append(np.concatenate(row, axis=1))
    return np.concatenate(rows)
