"""Smallest step between the depths that a sensor tells apart."""

from __future__ import annotations

import numpy as np

from gslts.change.constants import DEPTH_SAMPLES, MIN_DISTINCT_DEPTHS
from gslts.types import Floats32


def depth_quantum_m(depth: Floats32) -> float:
    """Return the median step between the distinct depths of a frame, m.

    Args:
        depth: [H,W] as measured, m; 0 and NaN where nothing was.

    Returns:
        The step; 0 where there are too few distinct depths to tell.
    """
    values = depth[np.isfinite(depth) & (depth > 0)]
    distinct = np.unique(values[:: max(1, len(values) // DEPTH_SAMPLES)])
    if len(distinct) < MIN_DISTINCT_DEPTHS:
        return 0.0
    return float(np.median(np.diff(distinct)))
