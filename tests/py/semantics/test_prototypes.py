"""Prototypes of the semantic features of a map."""

import numpy as np

from gslts._core.map import CHUNK_SIZE
from gslts.core.gaussian_map import GaussianMap
from gslts.semantics.prototypes import APART, MAX_OF_CHUNK, Prototypes


def map_of(features: np.ndarray, logit_opacities: np.ndarray) -> GaussianMap:
    size = len(features)
    return GaussianMap(
        means=np.zeros((size, 3), np.float32),
        quats=np.tile(np.float32([1, 0, 0, 0]), (size, 1)),
        log_scales=np.full((size, 3), -4, np.float32),
        logit_opacities=logit_opacities.astype(np.float32),
        sh=np.zeros((size, 1, 3), np.float32),
        features=features.astype(np.float32),
    )


def test_each_gaussian_is_like_a_prototype_of_its_chunk() -> None:
    rng = np.random.default_rng(0)
    centers = rng.normal(size=(12, 8))
    centers /= np.linalg.norm(centers, axis=1)[:, None]
    chunks = np.repeat(np.arange(3), CHUNK_SIZE)[:-100]
    kinds = 4 * chunks + rng.integers(0, 4, len(chunks))  # Four kinds of objects in each chunk.
    features = centers[kinds] + rng.uniform(-0.01, 0.01, (len(chunks), 8))
    found = Prototypes.of_map(map_of(features, np.full(len(chunks), 3)))
    np.testing.assert_array_equal(found.chunks, np.repeat(np.arange(3), 4))
    for chunk in range(3):
        own, own_kinds = found.features[found.chunks == chunk], kinds[chunks == chunk]
        apart = np.linalg.norm(features[chunks == chunk][:, None] - own, axis=2)
        assert apart.min(axis=1).max() < APART
        counts = np.bincount(own_kinds - 4 * chunk, minlength=4)
        np.testing.assert_array_equal(np.sort(found.counts[found.chunks == chunk]), np.sort(counts))


def test_a_chunk_has_few_prototypes_and_gaussians_without_a_meaning_none() -> None:
    rng = np.random.default_rng(1)
    features = rng.normal(size=(2 * CHUNK_SIZE, 8))
    opacities = np.full(len(features), 3.0)
    features[::2] = 0
    opacities[CHUNK_SIZE:] = -3
    found = Prototypes.of_map(map_of(features, opacities))
    assert len(found.counts) == MAX_OF_CHUNK
    assert (found.chunks == 0).all()
    assert found.features.any(axis=1).all()
    assert found.counts.sum() == CHUNK_SIZE // 2
