"""Small maps of random numbers, and stores of versions of them."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from gslts.core.gaussian_map import GaussianMap
from gslts.mapping.density.control import join
from gslts.store.delta import ARRAYS
from gslts.store.map_store import BLOBS, MapStore


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
    """Some are gone, some moved, and some are new."""
    rng = np.random.default_rng(seed)
    kept = before.select(np.flatnonzero(rng.random(before.size) > 0.1))
    means = kept.means.copy()
    means[rng.random(kept.size) < 0.2] += np.float32(0.5)
    new = replace(random_map(7, seed), origin=before.origin)
    return join(replace(kept, means=means), new, next_id)


def assert_same(one: GaussianMap, other: GaussianMap) -> None:
    """Fail unless all arrays, ids and origins are equal."""
    for name in (*ARRAYS, "ids", "origin"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)


def grown(folder: Path, count: int) -> list[GaussianMap]:
    """Adds versions; all maps, the first one first."""
    with MapStore(folder, writable=True) as store:
        maps = [store.read()]
        for seed in range(1, count + 1):
            maps.append(edited(maps[-1], seed, store.version().next_id))
            store.commit(maps[-1], {"seed": seed})
    return maps


def blobs_of(folder: Path) -> list[Path]:
    """Return the files of arrays of a map folder."""
    return sorted((folder / BLOBS).glob("*/*.safetensors"))
