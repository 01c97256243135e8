"""DBSCAN and connected components, against scikit-learn and SciPy."""

import numpy as np
import pytest
from scipy.sparse import coo_array, csgraph
from sklearn.cluster import DBSCAN

from gslts.semantics.clusters import NOISE, connected_components, dbscan, linked_groups


@pytest.mark.parametrize("seed", range(20))
def test_clusters_are_those_of_scikit_learn(seed: int) -> None:
    rng = np.random.default_rng(seed)
    centers = rng.uniform(-0.5, 0.5, (rng.integers(1, 12), 3))
    points = np.concatenate(
        [
            centers[rng.integers(len(centers), size=300)] + rng.normal(0, 0.04, (300, 3)),
            rng.uniform(-0.6, 0.6, (100, 3)),
        ]
    )
    weights = rng.integers(1, 4, len(points))
    expected = DBSCAN(eps=0.07, min_samples=6).fit_predict(points, sample_weight=weights)
    assert len(set(expected)) > 1
    np.testing.assert_array_equal(dbscan(points, 0.07, 6, weights), expected)


def test_a_single_point_is_noise_unless_its_weight_is_sufficient() -> None:
    points = np.array([[0.0, 0, 0], [5, 0, 0]])
    assert dbscan(points, 0.1, 4, np.array([3, 4])).tolist() == [NOISE, 0]


def test_points_a_radius_apart_are_neighbours() -> None:
    points = np.array([[0.0, 0, 0], [0.25, 0, 0], [0.5, 0, 0], [0.75 + 1e-9, 0, 0]])
    assert dbscan(points, 0.25, 2, np.ones(4, np.intp)).tolist() == [0, 0, 0, NOISE]


@pytest.mark.parametrize("seed", range(5))
def test_components_are_those_of_scipy(seed: int) -> None:
    rng = np.random.default_rng(seed)
    pairs = rng.integers(0, 200, (120, 2))
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(200, 200))
    labels = csgraph.connected_components(graph, directed=False)[1]
    first = np.array([np.flatnonzero(labels == label)[0] for label in labels])
    np.testing.assert_array_equal(connected_components(200, pairs), first)


@pytest.mark.parametrize("seed", range(5))
def test_linked_groups_are_components_of_cells_that_touch(seed: int) -> None:
    points = np.random.default_rng(seed).uniform(-0.6, 0.6, (150, 3))
    cells = np.floor(points / 0.1)
    touch = abs(cells[:, None] - cells).max(axis=2) <= 1
    labels = csgraph.connected_components(coo_array(touch), directed=False)[1]
    groups = linked_groups(points, 0.1)
    assert len(set(labels)) == len(set(groups)) == len({*zip(labels, groups, strict=True)}) > 1
    assert groups.min() == 0


def test_a_long_chain_is_one_component() -> None:
    order = np.random.default_rng(0).permutation(5000)
    pairs = np.stack([order[:-1], order[1:]], axis=1)
    assert not connected_components(5000, pairs).any()


def test_without_edges_each_vertex_is_a_component() -> None:
    assert connected_components(3, np.empty((0, 2), np.intp)).tolist() == [0, 1, 2]
