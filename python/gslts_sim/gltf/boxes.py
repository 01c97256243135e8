"""Decomposition of a mesh into boxes, for tests of collision and support.

The mesh is cut by a grid whose planes lie on its own axis-aligned faces, so that box-like objects
are exact. A cell is filled if it is inside, and where the mesh is too thin for that, if a triangle
passes through it. Faces that belong to no filled cell become boxes without thickness.
"""

from __future__ import annotations

from itertools import permutations

import numpy as np

from gslts.types import Bools, Floats
from gslts_sim.gltf.voxels import crossed_cells, grid_planes, inside_cells

STEPS = (32, 16, 8, 4)
"""Numbers of cells along the longest edge; the first that gives few boxes is taken."""
MAX_BOXES = 48
"""Maximum number of boxes, except on the coarsest grid: collision tests compare every box of one
object with every box of another."""


def filling_boxes(corners: Floats) -> Floats:
    """Decompose a mesh into boxes.

    Their outer bounds are those of the mesh, and level faces are exact to `voxels.TOUCH_M`. A
    closed mesh is solid if its faces look outward, and a shell, such as a room, if they look
    inward.

    Args:
        corners: [F,3,3] float64, m: the corners of the triangles, counter-clockwise from outside.

    Returns:
        [B,2,3] float64, m: lower and upper corners; equal along one axis for sheets.
    """
    boxes: list[Floats] = []
    for steps in STEPS:
        max_boxes = MAX_BOXES if steps > STEPS[-1] else np.inf
        boxes = _boxes(corners, steps, max_boxes)
        if len(boxes) <= max_boxes:
            break
    bounds = np.stack([corners.min(axis=(0, 1)), corners.max(axis=(0, 1))])
    if not boxes:  # The mesh has no area.
        return bounds[None]
    found = np.array(boxes)
    # Where only a corner reaches the bounds, the outermost boxes are extended to them.
    lowest, highest = found[:, 0].min(axis=0), found[:, 1].max(axis=0)
    found[:, 0] = np.where(found[:, 0] == lowest, bounds[0], found[:, 0])
    found[:, 1] = np.where(found[:, 1] == highest, bounds[1], found[:, 1])
    return found


def _boxes(corners: Floats, steps: int, max_boxes: float) -> list[Floats]:
    """Return the boxes on a grid of at least `steps` cells along the longest edge."""
    planes = [grid_planes(corners, axis, steps) for axis in range(3)]
    inside, sheets = inside_cells(corners, planes)
    crossed = crossed_cells(corners, planes)
    # Crossed cells beside cells inside are left out: on average, that neither adds nor removes.
    filled = inside | (crossed & ~_dilate(inside))
    _reach_bounds(filled, crossed)
    boxes = _merge(filled, planes, None, max_boxes)
    for axis, sheet in enumerate(sheets):
        beside = np.zeros_like(sheet)
        lower, upper = _sides(axis)
        beside[upper] |= filled
        beside[lower] |= filled
        boxes += _merge(sheet & ~beside, planes, axis, max_boxes)
    return boxes


def _sides(axis: int) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
    """Return slices of all but the last, and of all but the first element along an axis."""
    lower, upper = [slice(None)] * 3, [slice(None)] * 3
    lower[axis], upper[axis] = slice(-1), slice(1, None)
    return tuple(lower), tuple(upper)


def _dilate(cells: Bools) -> Bools:
    """Return the cells and their neighbours across faces."""
    dilated = cells.copy()
    for axis in range(3):
        lower, upper = _sides(axis)
        dilated[lower] |= cells[upper]
        dilated[upper] |= cells[lower]
    return dilated


def _reach_bounds(filled: Bools, crossed: Bools) -> None:
    """Fill the crossed cells of the outermost layers that would remain empty."""
    for axis in range(3):
        layers, candidates = np.moveaxis(filled, axis, 0), np.moveaxis(crossed, axis, 0)
        for end in (0, -1) if len(layers) else ():
            if not layers[end].any():
                layers[end] |= candidates[end]


def _merge(
    cells: Bools, planes: list[Floats], sheet_axis: int | None, max_boxes: float
) -> list[Floats]:
    """Merge cells into few boxes, greedily; those of sheets have no thickness.

    Stops after `max_boxes` + 1 boxes.
    """
    left = cells.copy()
    starts, ends = [along[:-1] for along in planes], [along[1:] for along in planes]
    if sheet_axis is not None:
        starts[sheet_axis] = ends[sheet_axis] = planes[sheet_axis]
    free = [axis for axis in range(3) if axis != sheet_axis]
    boxes: list[Floats] = []
    while left.any() and len(boxes) <= max_boxes:
        seed = _seed(left, starts, ends, free)
        spans = [_extend(left, seed, order) for order in permutations(free)]
        found = [
            np.array([[starts[k][a], ends[k][b - 1]] for k, (a, b) in enumerate(span)]).T
            for span in spans
        ]
        best = int(np.argmax([np.prod((box[1] - box[0])[free]) for box in found]))
        left[tuple(slice(a, b) for a, b in spans[best])] = False
        boxes.append(found[best])
    return boxes


def _seed(left: Bools, starts: list[Floats], ends: list[Floats], free: list[int]) -> list[int]:
    """Return the cell with the largest product of the filled lengths along the free axes."""
    product = left.astype(np.float64)
    for axis in free:
        shape = [-1 if k == axis else 1 for k in range(3)]
        empty_end = np.where(left, -np.inf, ends[axis].reshape(shape))
        empty_start = np.where(left, np.inf, starts[axis].reshape(shape))
        since = np.maximum.accumulate(empty_end, axis=axis)
        until = np.flip(np.minimum.accumulate(np.flip(empty_start, axis), axis=axis), axis)
        length = np.minimum(until, ends[axis][-1]) - np.maximum(since, starts[axis][0])
        product *= np.where(left, length, 0)
    return [int(k) for k in np.unravel_index(int(product.argmax()), left.shape)]


def _extend(left: Bools, seed: list[int], order: tuple[int, ...]) -> list[tuple[int, int]]:
    """Extend a block of cells along one axis after another; return its span along each axis."""
    span = [(k, k + 1) for k in seed]
    for axis in order:
        rest = [slice(a, b) for a, b in span]
        rest[axis] = slice(None)
        others = tuple(k for k in range(3) if k != axis)
        row: Bools = left[tuple(rest)].min(axis=others)
        empty = np.flatnonzero(~row)
        k = seed[axis]
        start = int(empty[empty < k].max(initial=-1)) + 1
        end = int(empty[empty > k].min(initial=len(row)))
        span[axis] = (start, end)
    return span
