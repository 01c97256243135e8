"""Boxes that together fill a mesh: what decides about collisions and about what stands on what.

The mesh is cut by a grid whose planes lie on its own level and upright faces, so that box-like
things come out exactly. A cell is filled if it is inside, and where the mesh is too thin for that,
if a triangle passes through it. Faces that belong to no filled cell become boxes without thickness.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise, permutations

import numpy as np
from numpy.typing import NDArray

from gslts.types import Bools, Floats

Ints = NDArray[np.int64]

STEPS = (32, 16, 8, 4)
"""Cells along the longest edge; the first that gives few boxes is taken."""

MOST_BOXES = 48
"""Tests of collision compare every box of one object with every one of another."""

LEAST_CELL_M = 0.005

TOUCH_M = 0.001
"""Planes of the grid are no closer, and a triangle must reach so deep into a cell to fill it: half
of what counts as contact."""

LEAST_SIDES = 5
"""Of the six directions from a point inside, how many must say so: meshes often lack one side."""

OFF_CENTRE = (0.4871, 0.5119)
"""Where in the cells it is looked whether they are inside: their middles often lie on edges."""

PAIRS_AT_ONCE = 100_000


def filling_boxes(corners: Floats) -> Floats:
    """Boxes that fill a mesh closely.

    Their outer bounds are those of the mesh, and level faces are met to within TOUCH_M. A closed
    mesh is filled if it looks outward, and is a shell, such as a room, if it looks inward.

    Args:
        corners: [F,3,3] float64, m: the corners of the triangles, counter-clockwise from outside.

    Returns:
        [B,2,3] float64, m: lower and upper corners; those of sheets may be equal along one axis.
    """
    boxes: list[Floats] = []
    for steps in STEPS:
        most = MOST_BOXES if steps > STEPS[-1] else np.inf
        boxes = _boxes(corners, steps, most)
        if len(boxes) <= most:
            break
    bounds = np.stack([corners.min(axis=(0, 1)), corners.max(axis=(0, 1))])
    if not boxes:  # The mesh has no area.
        return bounds[None]
    found = np.array(boxes)
    # Where no more than a corner reaches the bounds, the outermost boxes are stretched to them.
    lowest, highest = found[:, 0].min(axis=0), found[:, 1].max(axis=0)
    found[:, 0] = np.where(found[:, 0] == lowest, bounds[0], found[:, 0])
    found[:, 1] = np.where(found[:, 1] == highest, bounds[1], found[:, 1])
    return found


def _boxes(corners: Floats, steps: int, most: float) -> list[Floats]:
    """The boxes on a grid of at least as many steps along the longest edge."""
    planes = [_planes(corners, axis, steps) for axis in range(3)]
    inside, sheets = _inside(corners, planes)
    crossed = _crossed(corners, planes)
    # Beside cells that are inside, the surface leaves out as much as it adds.
    filled = inside | (crossed & ~_grown(inside))
    _reach_bounds(filled, crossed)
    boxes = _merged(filled, planes, None, most)
    for axis, sheet in enumerate(sheets):
        beside = np.zeros_like(sheet)
        lower, upper = _sides(axis)
        beside[upper] |= filled
        beside[lower] |= filled
        boxes += _merged(sheet & ~beside, planes, axis, most)
    return boxes


def _planes(corners: Floats, axis: int, steps: int) -> Floats:
    """Coordinates of the grid's planes along an axis: those of faces, the larger first."""
    values = corners[:, :, axis]
    low, high = values.min(), values.max()
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat = np.ptp(values, axis=1) <= TOUCH_M / 10
    heights, group = np.unique(np.round(values[flat].mean(axis=1), 6), return_inverse=True)
    areas = np.bincount(group, np.abs(normals[flat, axis]), len(heights))
    planes = [low, high] if high > low else [low]
    for height in heights[np.argsort(-areas, kind="stable")]:
        if len(planes) <= steps and np.abs(np.array(planes) - height).min() >= TOUCH_M:
            planes.append(height)
    planes.sort()
    cell = max(LEAST_CELL_M, np.ptp(corners, axis=(0, 1)).max() / steps)
    pieces = [
        np.linspace(start, end, int(np.ceil((end - start) / cell - 1e-9)), endpoint=False)
        for start, end in pairwise(planes)
    ]
    return np.concatenate([*pieces, planes[-1:]])


def _pairs(first: Ints, last: Ints) -> Iterator[tuple[Ints, Ints]]:
    """Every row i with every index [D] from first[i] up to, not with, last[i]; in portions.

    Yields:
        Rows [P] and indices [P,D].
    """
    counts = np.maximum(last - first, 0)
    many = counts.prod(axis=1)
    portion = np.cumsum(many) // PAIRS_AT_ONCE
    for start, end in _runs(portion):
        rows = np.repeat(np.arange(start, end), many[start:end])
        before = np.cumsum(many[start:end]) - many[start:end]
        rest = np.arange(len(rows)) - np.repeat(before, many[start:end])
        index = np.empty((len(rows), first.shape[1]), np.int64)
        for axis in range(first.shape[1]):
            index[:, axis] = first[rows, axis] + rest % counts[rows, axis]
            rest //= counts[rows, axis]
        yield rows, index


def _runs(values: Ints) -> list[tuple[int, int]]:
    """Start and end of the stretches of equal values."""
    cuts = (np.flatnonzero(np.diff(values)) + 1).tolist()
    return list(zip([0, *cuts], [*cuts, len(values)], strict=True))


def _inside(corners: Floats, planes: list[Floats]) -> tuple[Bools, list[Bools]]:
    """Cells inside the mesh, and for each axis the faces of cells that the mesh covers.

    Along the lines through the cells, each triangle seen from behind is a way out of the mesh, and
    each seen from the front a way in.
    """
    shape = tuple(len(along) - 1 for along in planes)
    sides = np.zeros(shape, np.int64)
    sheets = []
    for axis in range(3):
        one, two = (axis + 1) % 3, (axis + 2) % 3
        seen = corners[:, :, [one, two]]
        points = [
            planes[a][:-1] + share * np.diff(planes[a])
            for a, share in zip((one, two), OFF_CENTRE, strict=True)
        ]
        middles = (planes[axis][:-1] + planes[axis][1:]) / 2
        ways = np.zeros((shape[one], shape[two], len(middles) + 1), np.int64)
        sheet = np.zeros((shape[one], shape[two], len(planes[axis])), np.bool_)
        first, last = (
            np.stack(
                [
                    np.searchsorted(points[k], reach(seen[:, :, k], axis=1), side)  # type: ignore[call-overload]
                    for k in range(2)
                ],
                axis=1,
            )
            for reach, side in ((np.min, "left"), (np.max, "right"))
        )
        for rows, index in _pairs(first, last):
            point = np.stack([points[0][index[:, 0]], points[1][index[:, 1]]], axis=1)
            to_corners = seen[rows] - point[:, None]
            weights = _cross(np.roll(to_corners, -1, axis=1), np.roll(to_corners, -2, axis=1))
            area = weights.sum(axis=1)
            hit = ((weights > 0).all(axis=1) | (weights < 0).all(axis=1)) & (area != 0)
            at = np.einsum("pk,pk->p", weights[hit], corners[rows[hit], :, axis]) / area[hit]
            column = index[hit, 0], index[hit, 1]
            np.add.at(ways, (*column, np.searchsorted(middles, at)), np.sign(area[hit]).astype(int))
            near = np.abs(planes[axis] - at[:, None]).argmin(axis=1)
            level = np.ptp(corners[rows[hit], :, axis], axis=1) <= TOUCH_M / 10
            level &= np.abs(planes[axis][near] - at) <= TOUCH_M
            sheet[column[0][level], column[1][level], near[level]] = True
        below = np.cumsum(ways, axis=2)[:, :, :-1]
        above = ways.sum(axis=2, keepdims=True) - below
        votes = (above > 0).astype(np.int64) + (below < 0)
        sides += np.moveaxis(votes, (0, 1, 2), (one, two, axis))
        sheets.append(np.moveaxis(sheet, (0, 1, 2), (one, two, axis)))
    return sides >= LEAST_SIDES, sheets


def _cross(first: Floats, second: Floats) -> Floats:
    """Third component of the cross product of vectors [...,2]."""
    result: Floats = first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]
    return result


def _crossed(corners: Floats, planes: list[Floats]) -> Bools:
    """Cells into which a triangle reaches deeper than TOUCH_M, by separating axes."""
    crossed = np.zeros([len(along) - 1 for along in planes], np.bool_)
    low, high = corners.min(axis=1), corners.max(axis=1)
    first = np.stack(
        [np.searchsorted(planes[k][1:], low[:, k] + TOUCH_M, "right") for k in range(3)], axis=1
    )
    last = np.stack(
        [np.searchsorted(planes[k][:-1], high[:, k] - TOUCH_M, "left") for k in range(3)], axis=1
    )
    within = (last - first == 1).all(axis=1)
    crossed[tuple(first[within].T)] = True
    last[within] = first[within]
    lower, upper = ([along[part] for along in planes] for part in (slice(-1), slice(1, None)))
    for rows, index in _pairs(first, last):
        ends = [np.stack([e[k][index[:, k]] for k in range(3)], axis=1) for e in (lower, upper)]
        halves = np.maximum((ends[1] - ends[0]) / 2 - TOUCH_M, 0)
        relative = corners[rows] - ((ends[0] + ends[1]) / 2)[:, None]
        edges = np.roll(relative, -1, axis=1) - relative
        across = np.cross(edges[:, :, None], np.eye(3)).reshape(-1, 9, 3)
        normal = np.cross(edges[:, :1], edges[:, 1:2])
        axes = np.concatenate([across, normal], axis=1)
        shadow = relative @ axes.transpose(0, 2, 1)
        reach = np.einsum("pak,pk->pa", np.abs(axes), halves)
        meets = ((shadow.min(axis=1) <= reach) & (shadow.max(axis=1) >= -reach)).all(axis=1)
        crossed[tuple(index[meets].T)] = True
    return crossed


def _sides(axis: int) -> tuple[tuple[slice, ...], tuple[slice, ...]]:
    """All but the last and all but the first along an axis."""
    lower, upper = [slice(None)] * 3, [slice(None)] * 3
    lower[axis], upper[axis] = slice(-1), slice(1, None)
    return tuple(lower), tuple(upper)


def _grown(cells: Bools) -> Bools:
    """The cells and their neighbours across faces."""
    grown = cells.copy()
    for axis in range(3):
        lower, upper = _sides(axis)
        grown[lower] |= cells[upper]
        grown[upper] |= cells[lower]
    return grown


def _reach_bounds(filled: Bools, crossed: Bools) -> None:
    """Fills what triangles cross in the outermost layers where those would remain empty."""
    for axis in range(3):
        layers, candidates = np.moveaxis(filled, axis, 0), np.moveaxis(crossed, axis, 0)
        for end in (0, -1) if len(layers) else ():
            if not layers[end].any():
                layers[end] |= candidates[end]


def _merged(
    cells: Bools, planes: list[Floats], sheet_axis: int | None, most: float
) -> list[Floats]:
    """Cells as few boxes, roughly the largest next; those of sheets have no thickness.

    After `most` boxes and one more it gives up.
    """
    left = cells.copy()
    starts, ends = [along[:-1] for along in planes], [along[1:] for along in planes]
    if sheet_axis is not None:
        starts[sheet_axis] = ends[sheet_axis] = planes[sheet_axis]
    free = [axis for axis in range(3) if axis != sheet_axis]
    boxes: list[Floats] = []
    while left.any() and len(boxes) <= most:
        seed = _seed(left, starts, ends, free)
        spans = [_extended(left, seed, order) for order in permutations(free)]
        found = [
            np.array([[starts[k][a], ends[k][b - 1]] for k, (a, b) in enumerate(span)]).T
            for span in spans
        ]
        best = int(np.argmax([np.prod((box[1] - box[0])[free]) for box in found]))
        left[tuple(slice(a, b) for a, b in spans[best])] = False
        boxes.append(found[best])
    return boxes


def _seed(left: Bools, starts: list[Floats], ends: list[Floats], free: list[int]) -> list[int]:
    """The cell with the greatest product of how far cells are filled along the free axes."""
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


def _extended(left: Bools, seed: list[int], order: tuple[int, ...]) -> list[tuple[int, int]]:
    """Start and end along each axis of a block of cells, extended along one axis after another."""
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
