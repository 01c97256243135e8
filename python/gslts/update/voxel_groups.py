"""Grouping of points by voxels: the points that are connected to a region."""

from __future__ import annotations

import numpy as np

from gslts.types import Bools, Floats
from gslts.update.region import Region

VOXEL_M = 0.04
"""Edge of the voxels that group points, m: about twice the noise of depth at 2 m."""
MIN_VIEWS = 2
"""Minimum number of views that must show a changed voxel, if there are so many views."""
MAX_DISTANCE_M = 0.8
"""Maximum distance from a detected region to a part of the same object, m."""
MAX_PAIRS = 1 << 20
"""Maximum number of pairs of voxels that are compared at a time; bounds memory to 24 MB."""


def connected_to_region(points: Floats, region: Region, max_gap: int) -> Bools:
    """Return the points that are connected to a region, directly or over other points.

    Args:
        points: [P,3] in the world frame, m.
        region: Start of the search.
        max_gap: Maximum distance of connected points along each axis, voxels.

    Returns:
        [P] bool.
    """
    cells = np.floor(points / VOXEL_M).astype(np.int64)
    near = region.contains(points, MAX_DISTANCE_M)
    reached = region.contains(points, VOXEL_M)
    frontier = cells[reached]
    while len(frontier):
        left = np.flatnonzero(near & ~reached)
        adjacent = np.zeros(len(left), np.bool_)
        parts = 1 + len(left) * len(frontier) // MAX_PAIRS
        for part in np.array_split(frontier, parts):
            gaps = np.abs(cells[left][:, None] - part).max(axis=2)
            adjacent |= (gaps <= max_gap).any(axis=1)
        reached[left[adjacent]] = True
        frontier = cells[left[adjacent]]
    return reached
