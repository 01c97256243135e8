"""Faces of objects on which other objects can stand."""

from __future__ import annotations

import numpy as np

from gslts.types import Floats
from gslts_sim.home import HomeObject

MIN_TOP_M2 = 0.004
"""Minimum area of a face that carries objects, m^2."""


def tops_m(obj: HomeObject) -> Floats:
    """Return the heights at which objects can stand on an object.

    Args:
        obj: A receptacle.

    Returns:
        [K] float64 in its own frame, rising, m.
    """
    areas = np.prod(obj.boxes[:, 1, :2] - obj.boxes[:, 0, :2], axis=1)
    heights: Floats = np.unique(obj.boxes[areas > MIN_TOP_M2][:, 1, 2])
    return heights


def top_near(obj: HomeObject, z: float) -> Floats:
    """Return the box around the boxes whose top is nearest to a height.

    Args:
        obj: A receptacle.
        z: Height in its own frame, m; inf for the highest.

    Returns:
        [2,3] float64, lower and upper corner in its own frame, m.
    """
    heights = tops_m(obj)
    height = heights[np.abs(np.minimum(z, heights[-1]) - heights).argmin()]
    areas = np.prod(obj.boxes[:, 1, :2] - obj.boxes[:, 0, :2], axis=1)
    boxes = obj.boxes[(obj.boxes[:, 1, 2] == height) & (areas > MIN_TOP_M2)]
    return np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])
