"""Occupancy of a grid of cells by a mesh, for `boxes`."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from gslts.types import Bools, Floats, Ints

MIN_CELL_M = 0.005
"""Minimum edge of a cell, m."""
TOUCH_M = 0.001
"""Minimum distance of planes, and depth of a triangle in a cell that it fills, m: half of
`oriented_boxes.CONTACT_M`."""
MIN_VOTES = 5
"""Minimum number of the six axis directions in which a cell must be inside; meshes often lack one
side."""
OFF_CENTRE = (0.4871, 0.5119)
"""Position of the test rays within a cell: its centre often lies on edges of triangles."""
BATCH = 100_000
"""Number of pairs of triangles and cells that are tested at once; limits memory."""


def grid_planes(corners: Floats, axis: int, steps: int) -> Floats:
    """Return the coordinates of the grid's planes along an axis: those of the largest faces.

    Args:
        corners: [F,3,3] float64, corners of the triangles, m.
        axis: 0 to 2.
        steps: Minimum number of cells along the longest edge.
    """
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
    cell = max(MIN_CELL_M, np.ptp(corners, axis=(0, 1)).max() / steps)
    pieces = [
        np.linspace(start, end, int(np.ceil((end - start) / cell - 1e-9)), endpoint=False)
        for start, end in pairwise(planes)
    ]
    return np.concatenate([*pieces, planes[-1:]])


def inside_cells(corners: Floats, planes: list[Floats]) -> tuple[Bools, list[Bools]]:
    """Return the cells inside the mesh, and for each axis the faces of cells that it covers.

    Along a line through cells, the mesh is left at each back face and entered at each front face.

    Args:
        corners: [F,3,3] float64, corners of the triangles, m.
        planes: Coordinates of the planes along each axis, m.
    """
    shape = tuple(len(along) - 1 for along in planes)
    votes = np.zeros(shape, np.int64)
    sheets = []
    for axis in range(3):
        crossings, sheet = _line_crossings(corners, planes, axis)
        below = np.cumsum(crossings, axis=2)[:, :, :-1]
        above = crossings.sum(axis=2, keepdims=True) - below
        order = (axis + 1) % 3, (axis + 2) % 3, axis
        along_axis = (above > 0).astype(np.int64) + (below < 0)
        votes += np.moveaxis(along_axis, (0, 1, 2), order)
        sheets.append(np.moveaxis(sheet, (0, 1, 2), order))
    return votes >= MIN_VOTES, sheets


def _line_crossings(corners: Floats, planes: list[Floats], axis: int) -> tuple[Ints, Bools]:
    """Intersect the lines through the cells along an axis with the triangles.

    Returns:
        Signed crossings [J,K,I+1] before each cell of a line, positive for back faces; and faces
        [J,K,I+1] of cells that the mesh covers.
    """
    j, k = (axis + 1) % 3, (axis + 2) % 3
    seen = corners[:, :, [j, k]]
    points = [
        planes[a][:-1] + offset * np.diff(planes[a])
        for a, offset in zip((j, k), OFF_CENTRE, strict=True)
    ]
    middles = (planes[axis][:-1] + planes[axis][1:]) / 2
    shape = len(points[0]), len(points[1])
    crossings = np.zeros((*shape, len(middles) + 1), np.int64)
    sheet = np.zeros((*shape, len(planes[axis])), np.bool_)
    first, last = (
        np.stack(
            [
                np.searchsorted(points[n], reach(seen[:, :, n], axis=1), side)  # type: ignore[call-overload]
                for n in range(2)
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
        signs = np.sign(area[hit]).astype(int)
        np.add.at(crossings, (*column, np.searchsorted(middles, at)), signs)
        near = np.abs(planes[axis] - at[:, None]).argmin(axis=1)
        level = np.ptp(corners[rows[hit], :, axis], axis=1) <= TOUCH_M / 10
        level &= np.abs(planes[axis][near] - at) <= TOUCH_M
        sheet[column[0][level], column[1][level], near[level]] = True
    return crossings, sheet


def crossed_cells(corners: Floats, planes: list[Floats]) -> Bools:
    """Return the cells that a triangle enters deeper than TOUCH_M, by separating axes.

    Args:
        corners: [F,3,3] float64, corners of the triangles, m.
        planes: Coordinates of the planes along each axis, m.
    """
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


def _pairs(first: Ints, last: Ints) -> Iterator[tuple[Ints, Ints]]:
    """Generate batches of all pairs of a row i and an index [D] in first[i] to last[i] - 1.

    Yields:
        Rows [P] and indices [P,D].
    """
    counts = np.maximum(last - first, 0)
    many = counts.prod(axis=1)
    portion = np.cumsum(many) // BATCH
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
    """Return start and end of the runs of equal values."""
    cuts = (np.flatnonzero(np.diff(values)) + 1).tolist()
    return list(zip([0, *cuts], [*cuts, len(values)], strict=True))


def _cross(first: Floats, second: Floats) -> Floats:
    """Return the third component of the cross product of vectors [...,2]."""
    result: Floats = first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]
    return result
