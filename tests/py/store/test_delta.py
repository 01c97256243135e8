"""Deltas between versions."""

from pathlib import Path

import numpy as np
import pytest
from store_maps import ROOM, edited, random_map

from gslts.store.causes import UpdateCause
from gslts.store.delta import Delta, apply_deltas, compute_delta
from gslts.store.map_store import MapStore


def test_a_delta_of_another_map_is_rejected() -> None:
    base = random_map(5)
    nothing = base.select(np.zeros(0, np.int64))
    gone = Delta(np.array([9], np.uint64), nothing, nothing)
    with pytest.raises(ValueError, match="a Gaussian that does not exist"):
        apply_deltas(base, [gone])


def test_difference_is_committed_like_the_map(tmp_path: Path) -> None:
    first = random_map(200)
    second = edited(first, 1, 200)
    keys = []
    for name, change in (("map", second), ("delta", compute_delta(first, second))):
        (tmp_path / name).mkdir()
        MapStore.create(tmp_path / name, first, ROOM)
        with MapStore(tmp_path / name, writable=True) as store:
            version = store.commit(change, UpdateCause())
            assert version.gaussians == second.size
            assert version.delta is not None
            keys.append((version.delta.key, version.next_id, version.touched))
            assert np.array_equal(store.read().means, second.means)
    assert keys[0] == keys[1]


def test_difference_from_another_map_is_rejected(tmp_path: Path) -> None:
    first, other = random_map(20), random_map(50)
    MapStore.create(tmp_path, first, ROOM)
    delta = compute_delta(other, other.select(np.arange(40)))
    with MapStore(tmp_path, writable=True) as store:
        with pytest.raises(ValueError, match="removed: not all are Gaussians of the newest"):
            store.commit(delta, UpdateCause())
        assert len(store.versions()) == 1
