"""Extent of a change: grows a detected region to the whole object.

A detector may report only a part of an object, such as the shade of a lamp. Views from several
sides show which surfaces beside the region changed as well.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np

from gslts._core.fusion import SurfaceVoxels
from gslts.change.constants import MAX_FINE_QUANTUM_M
from gslts.types import Bools, Floats, Floats32
from gslts.update.flat_objects import find_flat_object, recolored_pixels
from gslts.update.region import Region, Side
from gslts.update.views import View, pixels_in_region
from gslts.update.voxel_groups import MIN_VIEWS, VOXEL_M, connected_to_region

DEPTH_STEP_M, DEPTH_STEP_PER_M = 0.025, 0.006
"""Minimum difference of depth between two surfaces: a constant, m (for flat objects the step of
coarse depths if it is larger), and a factor of the squared depth, 1/m, as the noise of a
structured-light camera grows."""
EDGE_WINDOW_PX = 5
"""A surface must be nearer than all others in a window of this size, because edges may be
misplaced by two pixels."""
MAX_GAP_VOXELS = 3
"""Maximum gap between parts of one object along each axis, voxels."""


def extend_regions(
    regions: Sequence[Region], views: Sequence[View]
) -> tuple[tuple[Region, ...], tuple[View, ...]]:
    """Grow regions and masks to all surfaces that are connected to what was detected.

    Args:
        regions: As detected.
        views: Of these regions.

    Returns:
        The regions with larger boxes, and the views with larger masks.
    """
    changed: dict[Side, list[Bools]] = {
        side: [_changed_pixels(view, side) for view in views] for side in ("before", "after")
    }
    recolored = [
        recolored_pixels(view, max(DEPTH_STEP_M, view.depth_quantum_m), DEPTH_STEP_PER_M)
        for view in views
    ]
    masks: dict[Side, list[Bools]] = {
        "before": [view.before.copy() for view in views],
        "after": [view.after.copy() for view in views],
    }
    grown = []
    for region in regions:
        side = region.side
        points = _changed_points(region, views, changed[side])
        points = points[connected_to_region(points, region, MAX_GAP_VOXELS)]
        larger = region.include(points - VOXEL_M / 2, points + VOXEL_M / 2)
        for view, mask, own in zip(views, masks[side], changed[side], strict=True):
            mask |= own & pixels_in_region(_depth(view, side), view.camera, larger, VOXEL_M / 2)
        if side == "after":
            points, flat = find_flat_object(larger, views, recolored)
            larger = larger.include(points - VOXEL_M / 2, points + VOXEL_M / 2)
            for mask, own in zip(masks["after"], flat, strict=True):
                mask |= own
        grown.append(larger)
    triples = zip(views, masks["before"], masks["after"], strict=True)
    return tuple(grown), tuple(
        replace(v, before=before, after=after) for v, before, after in triples
    )


def _depth(view: View, side: Side) -> Floats32:
    """Return the [H,W] depth before or after the change, m; 0 where it is unknown."""
    return view.rendered_depth if side == "before" else view.depth


def _changed_pixels(view: View, side: Side) -> Bools:
    """Return [H,W] pixels whose surface of one side is nearer than all of the other side around.

    None where depth is coarse: a table would be nearer by a step here and there, and so be a part
    of what stands on it.
    """
    depth = _depth(view, side)
    if view.depth_quantum_m > MAX_FINE_QUANTUM_M:
        return np.zeros(depth.shape, np.bool_)
    other = _depth(view, "after" if side == "before" else "before")
    known = np.where(other > 0, other, np.float32(np.inf))
    nearest = cv2.erode(known, np.ones((EDGE_WINDOW_PX, EDGE_WINDOW_PX), np.uint8))
    step_m = DEPTH_STEP_M + DEPTH_STEP_PER_M * depth**2
    return np.asarray((depth > 0) & np.isfinite(nearest) & (depth < nearest - step_m), np.bool_)


def _changed_points(region: Region, views: Sequence[View], masks: Sequence[Bools]) -> Floats:
    """Return [P,3] changed surface points, one per voxel that enough views show, m."""
    voxels = SurfaceVoxels(VOXEL_M, 1)
    for view, mask in zip(views, masks, strict=True):
        depth = np.ascontiguousarray(_depth(view, region.side))
        voxels.add(depth, view.frame.rgb, view.camera, np.ascontiguousarray(mask))
    _, sums, hits = voxels.voxels()
    points: Floats = (sums[:, 1:4] / sums[:, :1])[hits >= min(MIN_VIEWS, len(views))]
    return points
