"""Conversion between Unity's coordinates and those of the project.

Unity's world is left-handed, x right, y up, z forward, in metres; a yaw turns about y, clockwise
seen from above, in degrees from z towards x. The project's world is right-handed with z up.
Exchanging y and z converts one into the other.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from gslts.types import Floats


def in_world(vector: Mapping[str, Any]) -> Floats:
    """Convert a point, or lengths along the axes, from Unity's frame to the world.

    Args:
        vector: x, y and z in Unity's frame, m.

    Returns:
        (3,) in the world, m.

    Raises:
        ValueError: A coordinate is missing, or not a finite number.
    """
    try:
        point = np.array([vector["x"], vector["z"], vector["y"]], np.float64)
    except (KeyError, TypeError, ValueError):
        point = np.full(3, np.nan)
    if not np.all(np.isfinite(point)):
        raise ValueError(f"in_world: vector: expected finite x, y and z, got {vector!r}")
    return point


def unity_from_world(point: ArrayLike) -> dict[str, float]:
    """Convert a point from the world to Unity's frame.

    Args:
        point: (3,) in the world, m.

    Returns:
        x, y and z, m, as AI2-THOR's actions take them.

    Raises:
        ValueError: The point is not three finite numbers.
    """
    array = np.asarray(point, np.float64)
    if array.shape != (3,) or not np.all(np.isfinite(array)):
        raise ValueError(f"unity_from_world: point: expected three finite numbers, got {point!r}")
    x, y, z = array.tolist()
    return {"x": x, "y": z, "z": y}


def yaw_in_world(unity_yaw_deg: float) -> float:
    """Convert a yaw from Unity's frame to the world.

    Args:
        unity_yaw_deg: About Unity's y, from z towards x, degrees.

    Returns:
        About the world's z, from x to y, rad in [-pi, pi).
    """
    # Unity's yaw 0 is along its z, the world's y; from there the two turn in opposite directions.
    return float((1.5 * np.pi - np.deg2rad(unity_yaw_deg)) % (2 * np.pi) - np.pi)


def unity_yaw_from_world(yaw_rad: float) -> float:
    """Convert a yaw from the world to Unity's frame.

    Args:
        yaw_rad: About the world's z, from x to y, rad.

    Returns:
        About Unity's y, from z towards x, degrees in [0, 360).
    """
    return float((90.0 - np.rad2deg(yaw_rad)) % 360.0)
