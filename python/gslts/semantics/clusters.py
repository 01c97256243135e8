"""Clusters of points by density, and groups of what is linked, in NumPy.

scikit-learn has both, but importing it takes longer than a query.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from gslts.types import Floats

Rows = NDArray[np.intp]

MOST_CELLS = 1 << 19
"""Cells on each side of the origin; what is beyond is taken to be there."""
CELL_STRIDES = np.array([1 << 42, 1 << 21, 1], np.int64)
STRAY = -1
HALF = [
    int(np.array(step) @ CELL_STRIDES)
    for step in product((-1, 0, 1), repeat=3)
    if step >= (0, 0, 0)
]
"""From a cell to itself and to half of its neighbours: each pair of cells is met once."""


def cells_of(points: Floats, edge_m: float) -> NDArray[np.int64]:
    """Numbers the cells of points; numbers of neighbours differ by `CELL_STRIDES`.

    Args:
        points: [K,3] m.
        edge_m: Of a cell.

    Returns:
        [K]
    """
    cells = np.floor(points / edge_m).clip(-MOST_CELLS, MOST_CELLS).astype(np.int64)
    numbers: NDArray[np.int64] = cells @ CELL_STRIDES
    return numbers


def dbscan(points: Floats, radius_m: float, least: int, weights: NDArray[np.intp]) -> Rows:
    """Clusters points as DBSCAN does (Ester et al. 1996).

    Args:
        points: [K,3] m, at least one.
        radius_m: Points no farther from each other are neighbours.
        least: Weight of a point and its neighbours from which on it is inside a cluster.
        weights: [K] of the points.

    Returns:
        [K] number of the cluster, in the order of their first inner points; `STRAY` for none. A
        point at the edge of several belongs to the first of them.
    """
    pairs = _pairs(points, radius_m)
    both = np.concatenate([pairs, pairs[:, ::-1]])
    around = weights + np.bincount(both[:, 0], weights[both[:, 1]], len(points))
    inner = around >= least
    groups = connected_components(len(points), pairs[inner[pairs].all(axis=1)])
    labels = np.full(len(points), len(points))
    labels[inner] = np.unique(groups[inner], return_inverse=True)[1]
    edges = both[~inner[both[:, 0]] & inner[both[:, 1]]]
    np.minimum.at(labels, edges[:, 0], labels[edges[:, 1]])
    labels[labels == len(points)] = STRAY
    return labels


def connected_components(count: int, pairs: Rows) -> Rows:
    """Groups what pairs link, directly or by others.

    Args:
        count: Of the members.
        pairs: [P,2] members that belong together.

    Returns:
        [count] the least member of the group of each.
    """
    least = np.arange(count)
    while len(pairs):
        found = least[pairs]
        pairs = pairs[found[:, 0] != found[:, 1]]
        ends = least[pairs]
        np.minimum.at(least, ends.max(axis=1), ends.min(axis=1))
        while not np.array_equal(least, least[least]):
            least = least[least]
    return least


def _pairs(points: Floats, radius_m: float) -> Rows:
    """[P,2] all pairs of points that are no farther from each other, each once."""
    numbers = cells_of(points, radius_m)
    order = np.argsort(numbers, kind="stable")
    cells, starts, counts = np.unique(numbers[order], return_index=True, return_counts=True)
    found = []
    for step in HALF:
        at = np.searchsorted(cells, cells + step)
        at[at == len(cells)] = 0
        own = np.flatnonzero(cells[at] == cells + step)
        found.append(_products(starts[own], counts[own], starts[at[own]], counts[at[own]]))
    rows = order[np.concatenate(found)]
    # A cell met itself: each pair there came twice, and each point with itself.
    same = numbers[rows[:, 0]] == numbers[rows[:, 1]]
    rows = rows[~same | (rows[:, 0] < rows[:, 1])]
    offsets = points[rows[:, 0]] - points[rows[:, 1]]
    near: Rows = rows[np.einsum("ij,ij->i", offsets, offsets) <= radius_m**2]
    return near


def _products(starts: Rows, counts: Rows, others: Rows, other_counts: Rows) -> Rows:
    """[P,2] each of `counts` numbers from a start on, with each of the others of its line."""
    sizes = counts * other_counts
    line = np.repeat(np.arange(len(sizes)), sizes)
    nth = np.arange(sizes.sum()) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    return np.stack(
        [starts[line] + nth // other_counts[line], others[line] + nth % other_counts[line]], axis=1
    )
