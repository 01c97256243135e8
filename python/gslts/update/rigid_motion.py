"""Rigid motion of the Gaussians of shifted objects.

Furniture that was pushed by some centimetres overlaps its old position. If it was removed and added
anew, all that the map knew of it would be lost: sides that no view shows, its semantic features and
its identity. So its Gaussians are moved, and the pre-editing only fills what became visible.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gslts._core import edit as _core
from gslts.core.camera import Camera
from gslts.core.edited_map import edit_map
from gslts.core.gaussian_map import GaussianMap
from gslts.core.se3 import inverse_transform, transform
from gslts.core.similarity import rotate_quats
from gslts.core.spherical_harmonics import rotate_harmonics
from gslts.mapping.density.control import axes_of
from gslts.types import Bools, Floats, Floats32, Ints, Ints32
from gslts.update.extent import DEPTH_STEP_M, DEPTH_STEP_PER_M
from gslts.update.region import Region
from gslts.update.selection import float_view, gaussians_in_regions
from gslts.update.views import View

MARGIN_M = 0.05
"""Margin around the box of a shifted object in which its Gaussians lie, m. The box is around
measured points, and the far side may be hidden. With 0.03, a fifth of a round bin stays behind;
with 0.08, a fifth more than the bin moves."""
MAX_COLOR_STEP = 0.15
"""Maximum difference of the colours of one surface, sum of the channels: `min_flat_color` of the
detector."""
WINDOW_PX = 1
"""A surface may be found so many pixels beside its projection: edges of depth are no sharper."""
NEIGHBORS = 8
"""Undecided Gaussians follow the majority of so many of the nearest decided ones."""
MIN_DECIDED = 20
"""Minimum number of Gaussians that views see moving. Fewer are errors of single pixels."""
LAYER_M = 0.02
"""Thickness of the layers in which a supporting plane is searched, m; flat Gaussians on a floor
scatter by less."""
MIN_SUPPORT_SHARE = 0.25
"""Minimum area of horizontal Gaussians in the layer of a supporting plane, as a share of the
footprint of the object."""
MIN_VERTICAL = 0.9
"""Minimum vertical component of the normal of a horizontal Gaussian."""
SUPPORT_MARGIN_M = 0.1
"""Margin around the footprint in which the supporting plane is searched, m: below the object the
map may not show it."""


def move_gaussians(gaussian_map: GaussianMap, rows: Bools, motion: Floats) -> GaussianMap:
    """Move some Gaussians rigidly; they keep ids, semantic features and all other attributes.

    Args:
        gaussian_map: The map.
        rows: [N] bool, Gaussians to move.
        motion: [4,4] rigid, world, m: x_after = motion @ x_before.

    Returns:
        The map with the moved Gaussians in the same order.
    """
    part, origin = gaussian_map.select(rows), gaussian_map.origin
    means = transform(motion, part.means + origin) - origin
    moved = replace(
        part,
        means=means.astype(part.dtype),
        quats=rotate_quats(part.quats, motion[:3, :3]).astype(part.dtype),
        sh=rotate_harmonics(part.sh, motion[:3, :3]).astype(part.dtype),
    )
    none = np.zeros(0, np.intp)
    return edit_map(gaussian_map, np.flatnonzero(rows), moved, none, part.select(none))


def select_shifted(
    gaussian_map: GaussianMap, views: Sequence[View], regions: Sequence[Region], motion: Floats
) -> Bools:
    """Select the Gaussians of a shifted object.

    Each view votes on what it shows: a Gaussian moved if the frame agrees with it after the motion,
    and shows something else at its old position; it stayed in the opposite case. Where both agree,
    as inside of a surface without texture, or where nothing is seen, Gaussians follow their
    neighbours. The supporting plane never moves.

    Args:
        gaussian_map: float32, as rendered in the views.
        views: Of the change.
        regions: Of the shift; its box is that of the side "before".
        motion: [4,4] rigid, world, m: x_after = motion @ x_before.

    Returns:
        [N] bool; none if too few Gaussians are seen moving.
    """
    boxes = [region for region in regions if region.side == "before"]
    inside = gaussians_in_regions(gaussian_map, boxes, MARGIN_M)
    rows = np.flatnonzero(inside)
    shifted = np.zeros(gaussian_map.size, np.bool_)
    points = gaussian_map.centers(rows)
    votes = np.zeros(len(rows), np.int64)
    for view in views:
        votes += _vote(view, points, motion)
    if np.count_nonzero(votes > 0) < MIN_DECIDED:
        return shifted
    above = points[:, 2] > _support_m(gaussian_map, boxes, points[votes > 0]) + LAYER_M / 2
    votes[~above] = 0
    moved = votes > 0
    undecided = np.flatnonzero(above & (votes == 0))
    decided = np.flatnonzero(votes != 0)
    if len(undecided) and len(decided):
        known = float_view(gaussian_map.select(rows[decided]))
        others = gaussian_map.select(rows[undecided]).means
        nearest, _ = _core.nearest_gaussians(known, others, NEIGHBORS)
        moved[undecided] = 2 * moved[decided][nearest].sum(axis=1) > nearest.shape[1]
    shifted[rows[moved]] = True
    return shifted


def _vote(view: View, points: Floats, motion: Floats) -> Ints:
    """Return [P] 1 for points that a view sees moved, -1 for those that stayed, 0 if neither."""
    visible, colors = _rendered_colors(view, points)
    votes = np.zeros(len(points), np.int64)
    before = _compare(view, points[visible], colors)
    after = _compare(view, transform(motion, points[visible]), colors)
    votes[visible] = ((after > 0) & (before < 0)).astype(np.int64) - ((before > 0) & (after < 0))
    return votes


def _rendered_colors(view: View, points: Floats) -> tuple[Ints, Floats32]:
    """Return the rows of the points [P,3] that the map shows in a view, and their colours [V,3]."""
    pixels, depths_m = project_points(view.camera, points, 0)
    column, row = pixels.T
    surface_m = view.rendered_depth[row, column]
    visible = (depths_m > 0) & (surface_m > 0)
    visible &= np.abs(surface_m - depths_m) <= depth_tolerance_m(view, depths_m)
    rows = np.flatnonzero(visible)
    return rows, view.rendered_rgb[row[rows], column[rows]]


def _compare(view: View, points: Floats, colors: Floats32) -> Ints:
    """Compare points with a frame.

    Args:
        view: Of the frame.
        points: [P,3] world, m.
        colors: [P,3] sRGB, 0 to 1, at the exposure of the map.

    Returns:
        [P] 1 if the frame shows the point, -1 if it shows another surface there, 0 if it shows
        nothing or what is before it.
    """
    pixels, depths_m = project_points(view.camera, points, WINDOW_PX)
    tolerance_m = depth_tolerance_m(view, depths_m)
    observed, measured = view.colors, view.depth
    same = np.zeros(len(points), np.bool_)
    for dy in range(-WINDOW_PX, WINDOW_PX + 1):
        for dx in range(-WINDOW_PX, WINDOW_PX + 1):
            column, row = pixels[:, 0] + dx, pixels[:, 1] + dy
            near = np.abs(measured[row, column] - depths_m) <= tolerance_m
            step = np.abs(observed[row, column] - colors).sum(axis=1)
            same |= near & (step <= MAX_COLOR_STEP)
    center_m = measured[pixels[:, 1], pixels[:, 0]]
    known = (depths_m > 0) & (center_m > 0) & (center_m >= depths_m - tolerance_m)
    return np.where(depths_m > 0, np.where(same, 1, np.where(known, -1, 0)), 0)


def project_points(camera: Camera, points: Floats, margin_px: int) -> tuple[Ints32, Floats]:
    """Project points into an image.

    Args:
        camera: Of the image.
        points: [P,3] world, m.
        margin_px: Points nearer to the border of the image count as outside.

    Returns:
        [P,2] int32 column and row, and [P] depths, m, 0 where a point is outside of the image.
    """
    x, y, z = inverse_transform(camera.world_from_camera, points).T
    front = np.where(z > 0, z, np.inf)
    u, v = camera.fx * x / front + camera.cx, camera.fy * y / front + camera.cy
    inside = (z > 0) & (u >= margin_px) & (u < camera.width - margin_px)
    inside &= (v >= margin_px) & (v < camera.height - margin_px)
    pixels = np.column_stack([np.where(inside, u, margin_px), np.where(inside, v, margin_px)])
    return pixels.astype(np.int32), np.where(inside, z, 0.0)


def depth_tolerance_m(view: View, depths_m: Floats) -> Floats:
    """Return [P] the maximum difference of two depths of one surface, m.

    Args:
        view: Of the measured depths.
        depths_m: [P] m.
    """
    step_m = max(DEPTH_STEP_M, view.depth_quantum_m)
    tolerance_m: Floats = step_m + DEPTH_STEP_PER_M * depths_m**2
    return tolerance_m


def _support_m(gaussian_map: GaussianMap, boxes: Sequence[Region], moving: Floats) -> float:
    """Return the height of the highest plane below an object, world, m; -inf if there is none.

    Args:
        gaussian_map: The map.
        boxes: Around the object.
        moving: [M,3] Gaussians that were seen moving, world, m.
    """
    lowest_m = float(np.quantile(moving[:, 2], 1 / MIN_DECIDED))
    low = np.min([box.low for box in boxes], axis=0)
    high = np.max([box.high for box in boxes], axis=0)
    around = Region("before", np.array([*low[:2], -np.inf]), np.array([*high[:2], lowest_m]))
    margin = np.array([SUPPORT_MARGIN_M, SUPPORT_MARGIN_M, LAYER_M])
    near = gaussian_map.rows_in_box(around.low - margin, around.high + margin)
    rows = near[around.contains(gaussian_map.centers(near), margin)]
    below = gaussian_map.select(rows)
    scales = np.exp(below.log_scales.astype(np.float64))
    axis = scales.argmin(axis=1)
    vertical = np.abs(axes_of(below.quats)[np.arange(len(rows)), axis, 2])
    areas_m2 = np.pi * np.prod(np.sort(scales, axis=1)[:, 1:], axis=1)
    horizontal = vertical >= MIN_VERTICAL
    heights_m, areas_m2 = gaussian_map.centers(rows)[horizontal, 2], areas_m2[horizontal]
    layers = np.floor(heights_m / LAYER_M).astype(np.int64)
    footprint_m2 = float(np.prod((high - low)[:2]))
    for layer in np.unique(layers)[::-1]:
        # A plane may lie between two layers.
        own = (layers == layer) | (layers == layer - 1)
        if areas_m2[own].sum() >= MIN_SUPPORT_SHARE * footprint_m2:
            return float(np.median(heights_m[own]))
    return -np.inf
