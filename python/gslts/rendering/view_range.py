"""Range to which a map is rendered for the comparison with a frame."""

from __future__ import annotations

import numpy as np

from gslts.types import Floats32

MIN_RANGE_M, RANGE_SHARE = 6.0, 1.25
"""Minimum range, m, and range over the largest depth of a frame. Maps leak light: without a limit,
all rooms behind a wall are rendered, and add 1 % to its colours. The first keeps what a new object
hides, the second is a margin for errors of map and measurement."""


def view_range_m(depth: Floats32) -> float:
    """Return the distance beyond which the map is not compared with a frame.

    Args:
        depth: [H,W] measured z, m; 0 or NaN where there is none.

    Returns:
        Far plane of the rendering, m; infinite if no depth was measured.
    """
    largest_m = float(np.nan_to_num(depth).max(initial=0))
    return max(MIN_RANGE_M, RANGE_SHARE * largest_m) if largest_m > 0 else np.inf
