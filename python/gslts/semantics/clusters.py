"""DBSCAN and connected components in NumPy.

scikit-learn and SciPy have both, but importing them takes longer than a query.
"""

from __future__ import annotations

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
    components = connected_components(len(points), pairs[is_core[pairs].all(axis=1)])
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
        np.minimum.at(smallest, ends.max(axis=1), ends.min(axis=1))
        while not np.array_equal(smallest, smallest[smallest]):
            smallest = smallest[smallest]
    return smallest


def _neighbour_pairs(points: Floats, radius_m: float) -> Indices:
    """Return [P,2] all pairs of points within the radius, each once."""
    keys = cell_keys(points, radius_m)
    order = np.argsort(keys, kind="stable")
    cells, starts, counts = np.unique(keys[order], return_index=True, return_counts=True)
    candidates = []
    for step in HALF_NEIGHBOURHOOD:
        at = np.searchsorted(cells, cells + step)
        at[at == len(cells)] = 0
        own = np.flatnonzero(cells[at] == cells + step)
        candidates.append(_products(starts[own], counts[own], starts[at[own]], counts[at[own]]))
    rows = order[np.concatenate(candidates)]
    # Within a cell, each pair occurs twice, and each point with itself.
    same = keys[rows[:, 0]] == keys[rows[:, 1]]
    rows = rows[~same | (rows[:, 0] < rows[:, 1])]
    offsets = points[rows[:, 0]] - points[rows[:, 1]]
    pairs: Indices = rows[np.einsum("ij,ij->i", offsets, offsets) <= radius_m**2]
    return pairs


def _products(
    starts: Indices, counts: Indices, other_starts: Indices, other_counts: Indices
) -> Indices:
    """Return [P,2] for each line the Cartesian product of two ranges, by starts and counts."""
    sizes = counts * other_counts
    line = np.repeat(np.arange(len(sizes)), sizes)
    nth = np.arange(sizes.sum()) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    first = starts[line] + nth // other_counts[line]
    return np.stack([first, other_starts[line] + nth % other_counts[line]], axis=1)
