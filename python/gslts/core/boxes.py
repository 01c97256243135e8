"""Axis-aligned boxes in the world, each a lower and an upper corner (3,), m."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gslts.types import Floats

Corners = Sequence[Floats] | Floats
"""Lower and upper corner."""


def volume(box: Corners) -> float:
    """Return the volume of a box, m3.

    Args:
        box: Lower and upper corner.
    """
    return float(np.prod(box[1] - box[0]))


def common_volume(a: Corners, b: Corners) -> float:
    """Return the volume of the intersection of two boxes, m3.

    Args:
        a: A box.
        b: Another one.
    """
    return float(np.prod(np.maximum(0, np.minimum(a[1], b[1]) - np.maximum(a[0], b[0]))))


def box_iou(a: Corners, b: Corners) -> float:
    """Return the intersection over union of two boxes; 0 if both are empty.

    Args:
        a: A box.
        b: Another one.
    """
    common = common_volume(a, b)
    union = volume(a) + volume(b) - common
    return common / union if union > 0 else 0.0
