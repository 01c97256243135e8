"""Distance within which a measured point is on a surface."""

from __future__ import annotations

from gslts.types import Floats

SURFACE_MARGIN_M, SURFACE_MARGIN_SHARE = 0.03, 0.02
"""A point within so many m, plus so much of its depth, of a surface is on it."""


def surface_margin_m(depth_m: Floats) -> Floats:
    """Return how far a point may be from a surface that it is on.

    Args:
        depth_m: [...] depths of the points in a camera, m.

    Returns:
        [...] distances along the depth, m.
    """
    return SURFACE_MARGIN_M + SURFACE_MARGIN_SHARE * depth_m
