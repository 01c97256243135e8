"""Small maps of random numbers, and stores of versions of them."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from gslts.core.gaussian_map import GaussianMap
from gslts.mapping.density.control import join
from gslts.store.causes import (
    MappingCause,
    RejectedUpdateCause,
    SemanticsCause,
    UpdateCause,
    UpdateRecord,
)
from gslts.store.delta import ARRAYS
from gslts.store.map_store import BLOBS, MapStore
from gslts.store.records import ObjectEvent

ROOM = MappingCause(dataset="room")
REJECTED = RejectedUpdateCause(record=UpdateRecord(rejected="no view shows it"))
ORACLE = SemanticsCause(
    source="oracle", dataset="room", levels=1, code_dims=8, names=("Mug",), autoencoder=64 * "0"
)
BOX = ((0.0, 0.0, 0.0), (0.1, 0.1, 0.2))


def addition(object_type: str) -> ObjectEvent:
    """Return the addition of an object."""
    return ObjectEvent(kind="addition", type=object_type, boxes=(None, BOX))


def random_map(size: int, seed: int = 0, features: int = 2) -> GaussianMap:
    """Return a map of random numbers, float32, with harmonics of degree 1."""
    rng = np.random.default_rng(seed)

    def normal(*shape: int) -> np.ndarray:
        return rng.normal(size=shape).astype(np.float32)

    return GaussianMap(
        means=normal(size, 3),
        quats=normal(size, 4) + np.float32(3),
        log_scales=normal(size, 3),
        logit_opacities=normal(size),
        sh=normal(size, 4, 3),
        features=normal(size, features),
        origin=np.array([1.0, -2.0, 0.5]),
    )


def edited(before: GaussianMap, seed: int, next_id: int) -> GaussianMap:
    """Return a map with some Gaussians removed, some moved, and some added."""
    rng = np.random.default_rng(seed)
    kept = before.select(np.flatnonzero(rng.random(before.size) > 0.1))
    means = kept.means.copy()
    means[rng.random(kept.size) < 0.2] += np.float32(0.5)
    new = replace(random_map(7, seed), origin=before.origin)
    return join(replace(kept, means=means), new, next_id)


def assert_same(first: GaussianMap, other: GaussianMap) -> None:
    """Fail unless all arrays, ids and origins are equal."""
    for name in (*ARRAYS, "ids", "origin"):
        np.testing.assert_array_equal(getattr(first, name), getattr(other, name), err_msg=name)


def grown(folder: Path, count: int) -> list[GaussianMap]:
    """Add versions to a store, and return all maps, oldest first."""
    with MapStore(folder, writable=True) as store:
        maps = [store.read()]
        for seed in range(1, count + 1):
            maps.append(edited(maps[-1], seed, store.version().next_id))
            store.commit(maps[-1], UpdateCause(round=seed))
    return maps


def blobs_of(folder: Path) -> list[Path]:
    """Return the files of arrays of a map folder."""
    return sorted((folder / BLOBS).glob("*/*.safetensors"))
