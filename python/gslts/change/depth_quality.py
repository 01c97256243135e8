"""Quality of the depth of a frame: fine, coarse or none."""

from __future__ import annotations

from typing import Literal

import numpy as np

from gslts.change.constants import (
    DEPTH_SAMPLES,
    MAX_FINE_QUANTUM_M,
    MIN_DISTINCT_DEPTHS,
    MIN_MEASURED_SHARE,
)
from gslts.types import Floats32

DepthQuality = Literal["fine", "coarse", "none"]
"""Fine depth shows changes; coarse depth shows whether a frame shows the place of the map."""


def depth_quantum_m(depth: Floats32) -> float:
    """Return the median step between the distinct depths of a frame, m.

    Args:
        depth: [K] or [H,W] as measured, m; 0 and NaN where nothing was.

    Returns:
        The step; 0 where there are too few distinct depths to tell.
    """
    values = depth[np.isfinite(depth) & (depth > 0)]
    distinct = np.unique(values[:: max(1, len(values) // DEPTH_SAMPLES)])
    if len(distinct) < MIN_DISTINCT_DEPTHS:
        return 0.0
    return float(np.median(np.diff(distinct)))


def depth_quality(depth: Floats32) -> DepthQuality:
    """Classify the depth of a frame.

    Args:
        depth: [K] as measured in the pixels of its mask, or [H,W], m; 0 and NaN where nothing was.

    Returns:
        "fine"; "coarse" with larger steps; "none" if hardly anything was measured.
    """
    measured = np.isfinite(depth) & (depth > 0)
    if not measured.any() or measured.mean() < MIN_MEASURED_SHARE:
        return "none"
    return "coarse" if depth_quantum_m(depth) > MAX_FINE_QUANTUM_M else "fine"
