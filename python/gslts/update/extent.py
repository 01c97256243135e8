"""How far a change reaches: from what was detected to all that hangs together with it.

A detector tells surfaces, and of a lamp perhaps the shade alone. Views from several sides tell what
else is new, or gone, beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from gslts._core.map import SurfaceVoxels
from gslts.update.region import Side, Site
from gslts.update.views import View, near_site

Floats = NDArray[np.float64]
Floats32 = NDArray[np.float32]
Bools = NDArray[np.bool_]

STEP_M, STEP_PER_M = 0.025, 0.006
"""A surface is nearer than another by so much, m, and by so much times its squared depth more."""
AROUND_PX = 5
"""Edges may be misplaced: it must be nearer than all in a window of such an edge."""
VOXEL_M = 0.04
GAP = 3
"""Parts of an object are at most so many voxels apart along each axis."""
LEAST_VIEWS = 2
MOST_M = 0.8
"""No farther than that beyond what was detected."""
MOST_PAIRS = 1 << 20
"""Of voxels that are compared at a time."""


def extended(
    sites: Sequence[Site], views: Sequence[View]
) -> tuple[tuple[Site, ...], tuple[View, ...]]:
    """Sites, and masks of views, with all that hangs together with what was detected.

    Args:
        sites: As detected.
        views: Of them.

    Returns:
        The sites with larger boxes, and the views with larger masks.
    """
    differing: dict[Side, list[Bools]] = {
        side: [_differing(view, side) for view in views] for side in ("before", "after")
    }
    grown = tuple(_grown(site, views, differing[site.side]) for site in sites)
    larger = []
    for number, view in enumerate(views):
        masks: dict[Side, Bools] = {"before": view.before, "after": view.after}
        for site in grown:
            inside = near_site(_surface(view, site.side), view.camera, site, VOXEL_M / 2)
            masks[site.side] = masks[site.side] | (inside & differing[site.side][number])
        larger.append(replace(view, before=masks["before"], after=masks["after"]))
    return grown, tuple(larger)


def _surface(view: View, side: Side) -> Floats32:
    """[H,W] depth of what is there at one of the times, m; 0 where it is not known."""
    return view.rendered if side == "before" else view.depth


def _differing(view: View, side: Side) -> Bools:
    """[H,W] where the surface of one time is nearer than all of the other around."""
    here = _surface(view, side)
    there = _surface(view, "after" if side == "before" else "before")
    known = np.where(there > 0, there, np.float32(np.inf))
    nearest = cv2.erode(known, np.ones((AROUND_PX, AROUND_PX), np.uint8))
    step_m = STEP_M + STEP_PER_M * here**2
    return np.asarray((here > 0) & np.isfinite(nearest) & (here < nearest - step_m), np.bool_)


def _grown(site: Site, views: Sequence[View], differing: Sequence[Bools]) -> Site:
    voxels = SurfaceVoxels(VOXEL_M, 1)
    for view, mask in zip(views, differing, strict=True):
        surface = np.ascontiguousarray(_surface(view, site.side))
        voxels.add(surface, view.frame.rgb, view.camera, np.ascontiguousarray(mask))
    _, sums, hits = voxels.voxels()
    points: Floats = (sums[:, 1:4] / sums[:, :1])[hits >= min(LEAST_VIEWS, len(views))]
    points = points[site.contains(points, MOST_M)]
    together = points[_connected(points, site.contains(points, VOXEL_M))]
    low = np.min([site.low, *(together - VOXEL_M / 2)], axis=0)
    high = np.max([site.high, *(together + VOXEL_M / 2)], axis=0)
    return Site(site.side, low, high)


def _connected(points: Floats, start: Bools) -> Bools:
    """[P] which points are reached from some over others that are near."""
    cells = np.floor(points / VOXEL_M).astype(np.int64)
    reached = start.copy()
    frontier = cells[reached]
    while len(frontier):
        left = np.flatnonzero(~reached)
        near = np.zeros(len(left), np.bool_)
        parts = 1 + len(left) * len(frontier) // MOST_PAIRS
        for part in np.array_split(frontier, parts):
            near |= (np.abs(cells[left][:, None] - part).max(axis=2) <= GAP).any(axis=1)
        reached[left[near]] = True
        frontier = cells[left[near]]
    return reached
