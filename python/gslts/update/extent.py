"""How far a change reaches: from what was detected to all that hangs together with it.

A detector tells surfaces, and of a lamp perhaps the shade alone, of a newspaper on a chair what
juts out. Views from several sides tell what else is new, or gone, beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from gslts._core.map import SurfaceVoxels
from gslts.camera import lifted
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
FLAT_GAP = 2
"""And of something that lies flat."""
OTHER_COLOR = 0.1
"""What lies flat differs in a colour by more."""
BLUR_PX = 3.0
"""In images so blurred, edges that are a pixel off do not differ."""
OUTLINE, EDGE_PX = 0.1, 8
"""Near its edge, the logarithms of its colours differ by so much more than those of what is around,
within so many pixels."""
DARK = 0.1
"""Added to colours, as the logarithms of black ones are mostly noise."""
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
    flat = _points(views, "after", [_recolored(view) for view in views])
    masks: dict[Side, list[Bools]] = {
        "before": [view.before.copy() for view in views],
        "after": [view.after.copy() for view in views],
    }
    grown = []
    for site in sites:
        points = _points(views, site.side, differing[site.side])
        larger = _around(site, points[_connected(points, site, GAP)])
        on_it = flat[_connected(flat, larger, FLAT_GAP)] if site.side == "after" else flat[:0]
        for view, mask, here in zip(views, masks[site.side], differing[site.side], strict=True):
            near = near_site(_surface(view, site.side), view.camera, larger, VOXEL_M / 2)
            mask |= (near & here) | _in_voxels_of(on_it, view)
        grown.append(_around(larger, on_it))
    pairs = zip(views, masks["before"], masks["after"], strict=True)
    return tuple(grown), tuple(replace(view, before=old, after=new) for view, old, new in pairs)


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


def _recolored(view: View) -> Bools:
    """[H,W] where something lies on a surface of the map that it does not have there."""
    step_m = STEP_M + STEP_PER_M * view.depth**2
    same = (view.depth > 0) & (view.rendered > 0) & (np.abs(view.depth - view.rendered) < step_m)
    if view.frame.mask is not None:
        same &= view.frame.mask
    other = same & (_blurred(view.colors - view.shown, same) > OTHER_COLOR)
    # Light changes what is bright by more; logarithms differ by the same for all that it falls on.
    ratios = np.log((view.colors.clip(0, 1) + DARK) / (view.shown.clip(0, 1) + DARK))
    return _outlined(other, _blurred(ratios, same), same)


def _blurred(apart: Floats32, where: Bools) -> Floats32:
    """[H,W] the largest absolute value of a pixel of an image [H,W,3], blurred within a part."""
    weights = where.astype(np.float32)  # What is before or behind has its own colours.
    blurred = cv2.GaussianBlur(apart * weights[..., None], (0, 0), BLUR_PX)
    known = cv2.GaussianBlur(weights, (0, 0), BLUR_PX)
    return np.asarray(np.abs(blurred).max(axis=2) / np.maximum(known, 1e-6), np.float32)


def _outlined(other: Bools, steps: Floats32, same: Bools) -> Bools:
    """[H,W] what has an edge at which colours change; light that changed has none."""
    around = np.ones((2 * EDGE_PX + 1, 2 * EDGE_PX + 1), np.uint8)
    _, labels = cv2.connectedComponents(other.astype(np.uint8))
    rest = same & ~other
    edge = other & (cv2.dilate(rest.astype(np.uint8), around) > 0)
    nearest = cv2.dilate(labels.astype(np.float32), around).astype(np.int64)
    inside, outside = (
        _means(steps, np.where(where, numbers, 0), labels.max())
        for where, numbers in ((edge, labels), (rest, nearest))
    )
    stands_out = inside > outside + OUTLINE
    stands_out[0] = False
    return np.asarray(stands_out[labels], np.bool_)


def _means(values: Floats32, labels: NDArray[np.int64], last: int) -> Floats:
    """[last + 1] of each label; 0 of those that nothing has."""
    sums = np.bincount(labels.ravel(), values.ravel(), last + 1)
    means: Floats = sums / np.maximum(np.bincount(labels.ravel(), minlength=last + 1), 1)
    return means


def _points(views: Sequence[View], side: Side, masks: Sequence[Bools]) -> Floats:
    """[P,3] of the surfaces of one time in some masks: one a voxel that enough views show."""
    voxels = SurfaceVoxels(VOXEL_M, 1)
    for view, mask in zip(views, masks, strict=True):
        surface = np.ascontiguousarray(_surface(view, side))
        voxels.add(surface, view.frame.rgb, view.camera, np.ascontiguousarray(mask))
    _, sums, hits = voxels.voxels()
    points: Floats = (sums[:, 1:4] / sums[:, :1])[hits >= min(LEAST_VIEWS, len(views))]
    return points


def _around(site: Site, points: Floats) -> Site:
    """The site with a box that points are in as well."""
    low = np.min([site.low, *(points - VOXEL_M / 2)], axis=0)
    high = np.max([site.high, *(points + VOXEL_M / 2)], axis=0)
    return Site(site.side, low, high)


def _in_voxels_of(points: Floats, view: View) -> Bools:
    """[H,W] where what a view measured is in a voxel of one of some points."""
    inside = np.zeros(view.depth.shape, np.bool_)
    if len(points) == 0:
        return inside
    own = np.floor(points / VOXEL_M).astype(np.int64)
    first = own.min(axis=0)
    filled = np.zeros(own.max(axis=0) - first + 1, np.bool_)
    filled[tuple((own - first).T)] = True
    box = Site("after", VOXEL_M * first, VOXEL_M * (first + filled.shape))
    inside = near_site(view.depth, view.camera, box, 0)
    rows, columns = np.nonzero(inside)
    places = np.column_stack([columns + 0.5, rows + 0.5])
    measured = lifted(view.camera, places, view.depth[rows, columns].astype(np.float64))
    cells = np.floor(measured / VOXEL_M).astype(np.int64) - first
    inside[rows, columns] = filled[tuple(cells.clip(0, np.array(filled.shape) - 1).T)]
    return inside


def _connected(points: Floats, site: Site, gap: int) -> Bools:
    """[P] which points are reached from a site over others, at most so many voxels apart."""
    cells = np.floor(points / VOXEL_M).astype(np.int64)
    near = site.contains(points, MOST_M)
    reached = site.contains(points, VOXEL_M)
    frontier = cells[reached]
    while len(frontier):
        left = np.flatnonzero(near & ~reached)
        beside = np.zeros(len(left), np.bool_)
        parts = 1 + len(left) * len(frontier) // MOST_PAIRS
        for part in np.array_split(frontier, parts):
            beside |= (np.abs(cells[left][:, None] - part).max(axis=2) <= gap).any(axis=1)
        reached[left[beside]] = True
        frontier = cells[left[beside]]
    return reached
