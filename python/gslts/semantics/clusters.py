"""DBSCAN and connected components in NumPy.

scikit-learn and SciPy have both, but importing them takes longer than a query.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np

from gslts.types import Floats, Floats32, Indices, Ints

MAX_CELL = 1 << 19
"""Largest cell coordinate; points beyond are clipped to it. 37 km for cells of 0.07 m."""
CELL_STRIDES = np.array([1 << 42, 1 << 21, 1], np.int64)
"""Key of a cell = its coordinates times these strides; keys of neighbours differ by strides."""
NOISE = -1
"""Label of points in no cluster."""
HALF_NEIGHBOURHOOD = [
    int(np.array(step) @ CELL_STRIDES)
    for step in product((-1, 0, 1), repeat=3)
    if step >= (0, 0, 0)
]
"""Key offsets to a cell itself and half of its 26 neighbours, so that each pair occurs once."""


def cell_keys(points: Floats | Floats32, edge_m: float) -> Ints:
    """Compute keys of the cells of points; keys of neighbours differ by `CELL_STRIDES`.

    Args:
        points: [K,3] m.
        edge_m: Edge of a cell, m.

    Returns:
        [K] int64.
    """
    cells = np.floor(points / edge_m).clip(-MAX_CELL, MAX_CELL).astype(np.int64)
    keys: Ints = cells @ CELL_STRIDES
    return keys


def linked_groups(points: Floats, edge_m: float) -> Indices:
    """Group points by cells that touch: points of several groups are more than an edge apart.

    Args:
        points: [K,3] m, at least one.
        edge_m: Edge of a cell, m.

    Returns:
        [K] number of the group of each point, from 0.
    """
    cells, cell_of = np.unique(cell_keys(points, edge_m), return_inverse=True)
    pairs = np.concatenate([np.stack(rows, axis=1) for rows in _touching(cells)])
    groups = np.unique(connected_components(len(cells), pairs), return_inverse=True)[1]
    return np.asarray(groups[cell_of], np.intp)


def dbscan(points: Floats, radius_m: float, min_weight: int, weights: Indices) -> Indices:
    """Cluster weighted points with DBSCAN (Ester et al. 1996).

    Args:
        points: [K,3] m, at least one.
        radius_m: Maximum distance of neighbours, m.
        min_weight: Minimum weight of a core point and its neighbours together.
        weights: [K] integer weights of the points.

    Returns:
        [K] cluster of each point, in the order of their first core points; `NOISE` for none. A
        border point of several clusters belongs to the first of them.
    """
    pairs = _neighbour_pairs(points, radius_m)
    both = np.concatenate([pairs, pairs[:, ::-1]])
    neighbourhoods = weights + np.bincount(both[:, 0], weights[both[:, 1]], len(points))
    is_core = neighbourhoods >= min_weight
    is_link = is_core[pairs[:, 0]] & is_core[pairs[:, 1]]
    components = connected_components(len(points), pairs[is_link])
    labels = np.full(len(points), len(points))
    labels[is_core] = np.unique(components[is_core], return_inverse=True)[1]
    borders = both[~is_core[both[:, 0]] & is_core[both[:, 1]]]
    np.minimum.at(labels, borders[:, 0], labels[borders[:, 1]])
    labels[labels == len(points)] = NOISE
    return labels


def connected_components(count: int, pairs: Indices) -> Indices:
    """Compute the connected components of an undirected graph.

    Args:
        count: Number of vertices.
        pairs: [P,2] edges.

    Returns:
        [count] the smallest vertex of the component of each vertex.
    """
    smallest = np.arange(count)
    while len(pairs):
        roots = smallest[pairs]
        pairs = pairs[roots[:, 0] != roots[:, 1]]
        ends = smallest[pairs]
        np.minimum.at(smallest, np.maximum(*ends.T), np.minimum(*ends.T))
        while not np.array_equal(smallest, smallest[smallest]):
            smallest = smallest[smallest]
    return smallest


def _neighbour_pairs(points: Floats, radius_m: float) -> Indices:
    """Return [P,2] all pairs of points within the radius, each once."""
    keys = cell_keys(points, radius_m)
    order = np.argsort(keys, kind="stable")
    cells, starts, counts = np.unique(keys[order], return_index=True, return_counts=True)
    candidates = [
        _products(starts[own], counts[own], starts[other], counts[other])
        for own, other in _touching(cells)
    ]
    first, second = np.concatenate(candidates, axis=1)
    ahead = first < second  # Within a cell, each pair occurs twice, and each point with itself.
    first, second = order[first[ahead]], order[second[ahead]]
    offsets = points.take(first, axis=0) - points.take(second, axis=0)  # Faster than points[first].
    near = np.einsum("ij,ij->i", offsets, offsets) <= radius_m**2
    return np.stack([first[near], second[near]], axis=1)


def _touching(cells: Ints) -> Iterator[tuple[Indices, Indices]]:
    """Yield both rows of all pairs of cells that touch, each once, and of each cell with itself.

    Args:
        cells: [C] keys, rising.
    """
    for step in HALF_NEIGHBOURHOOD:
        at = np.searchsorted(cells, cells + step)
        at[at == len(cells)] = 0
        own = np.flatnonzero(cells[at] == cells + step)
        yield own, at[own]


def _products(
    starts: Indices, counts: Indices, other_starts: Indices, other_counts: Indices
) -> Indices:
    """Return [2,P] for each line the Cartesian product of two ranges, by starts and counts."""
    sizes = counts * other_counts
    line = np.repeat(np.arange(len(sizes)), sizes)
    nth = np.arange(sizes.sum()) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    rows, others = np.divmod(nth, other_counts[line])
    return np.stack([starts[line] + rows, other_starts[line] + others])
