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

from gslts._core.fusion import SurfaceVoxels
from gslts.core.camera import unproject
from gslts.types import Bools, Floats, Floats32
from gslts.update.region import Region, Side
from gslts.update.views import View, near_region

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
    regions: Sequence[Region], views: Sequence[View]
) -> tuple[tuple[Region, ...], tuple[View, ...]]:
    """Sites, and masks of views, with all that hangs together with what was detected.

    Args:
        regions: As detected.
        views: Of them.

    Returns:
        The regions with larger boxes, and the views with larger masks.
    """
    differing: dict[Side, list[Bools]] = {
        side: [_differing(view, side) for view in views] for side in ("before", "after")
    }
    recolored = [_recolored(view) for view in views]
    masks: dict[Side, list[Bools]] = {
        "before": [view.before.copy() for view in views],
        "after": [view.after.copy() for view in views],
    }
    grown = []
    for region in regions:
        points = _points(region, views, differing[region.side])
        larger = _around(region, points[_connected(points, region, GAP)])
        for view, mask, here in zip(views, masks[region.side], differing[region.side], strict=True):
            mask |= here & near_region(
                _surface(view, region.side), view.camera, larger, VOXEL_M / 2
            )
        if region.side == "after":
            points, lying = _lying(larger, views, recolored)
            larger = _around(larger, points)
            for mask, here in zip(masks["after"], lying, strict=True):
                mask |= here
        grown.append(larger)
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


def _points(region: Region, views: Sequence[View], masks: Sequence[Bools]) -> Floats:
    """[P,3] of the surfaces of a region's time in some masks: one per voxel."""
    voxels = SurfaceVoxels(VOXEL_M, 1)
    for view, mask in zip(views, masks, strict=True):
        surface = np.ascontiguousarray(_surface(view, region.side))
        voxels.add(surface, view.frame.rgb, view.camera, np.ascontiguousarray(mask))
    _, sums, hits = voxels.voxels()
    points: Floats = (sums[:, 1:4] / sums[:, :1])[hits >= min(LEAST_VIEWS, len(views))]
    return points


def _lying(
    region: Region, views: Sequence[View], recolored: Sequence[Bools]
) -> tuple[Floats, list[Bools]]:
    """What lies flat in or beside a region.

    Returns:
        [P,3] the middles of its voxels, and [H,W] of each view, what it shows of them.
    """
    low = region.low - MOST_M
    shape = np.floor((region.high + MOST_M - low) / VOXEL_M).astype(np.int64) + 1
    measured, changed, showing = np.zeros((3, shape.prod()))
    places = []
    for view, other in zip(views, recolored, strict=True):
        rows, columns = np.nonzero(near_region(view.depth, view.camera, region, MOST_M))
        pixels = np.column_stack([columns + 0.5, rows + 0.5])
        points = unproject(view.camera, pixels, view.depth[rows, columns].astype(np.float64))
        cells = ((points - low) / VOXEL_M).astype(np.int64).clip(0, shape - 1)
        voxels = np.ravel_multi_index(tuple(cells.T), tuple(shape))
        counts = np.bincount(voxels, other[rows, columns], shape.prod())
        measured += np.bincount(voxels, minlength=shape.prod())
        changed += counts
        showing += counts > 0
        places.append((rows, columns, voxels))
    found = np.flatnonzero((changed > measured / 2) & (showing >= min(LEAST_VIEWS, len(views))))
    middles = low + VOXEL_M * (np.column_stack(np.unravel_index(found, tuple(shape))) + 0.5)
    together = _connected(middles, region, FLAT_GAP)
    lies = np.zeros(shape.prod(), np.bool_)
    lies[found[together]] = True
    masks = [np.zeros(view.depth.shape, np.bool_) for view in views]
    for mask, (rows, columns, voxels) in zip(masks, places, strict=True):
        mask[rows, columns] = lies[voxels]
    return middles[together], masks


def _around(region: Region, points: Floats) -> Region:
    """The region with a box that points are in as well."""
    low = np.min([region.low, *(points - VOXEL_M / 2)], axis=0)
    high = np.max([region.high, *(points + VOXEL_M / 2)], axis=0)
    return Region(region.side, low, high)


def _connected(points: Floats, region: Region, gap: int) -> Bools:
    """[P] which points are reached from a region over others, at most so many voxels apart."""
    cells = np.floor(points / VOXEL_M).astype(np.int64)
    near = region.contains(points, MOST_M)
    reached = region.contains(points, VOXEL_M)
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
