"""An update of a part of a large map: it does there what it does in a map of the part alone."""

from dataclasses import replace

import change_room
import numpy as np
import pytest
import update_room
from store_maps import assert_same

from gslts.change.detector import ChangeDetector
from gslts.core.gaussian_map import GaussianMap
from gslts.mapping.density.control import join
from gslts.store.causes import MappingCause
from gslts.store.delta import apply_deltas
from gslts.store.map_store import MapStore
from gslts.update.integrate import UpdateResult, integrate_changes

FAR_M, COPIES = 40.0, 12
"""Distance between copies of the room, and their number: enough that the map has bounds."""


def large_map() -> GaussianMap:
    """Return the map of the room, with copies far away."""
    room, _ = change_room.mapped()
    large = room
    for number in range(1, COPIES + 1):
        offset = np.array([FAR_M * number, 0, 0], np.float32)
        copy = replace(room, means=room.means + offset)
        large = join(large, copy, int(large.ids[-1]) + 1)
    return large


def update(gaussian_map: GaussianMap, kind: update_room.Kind, first_id: int) -> UpdateResult:
    cameras = list(change_room.mapped()[1].values())
    return integrate_changes(
        gaussian_map,
        cameras,
        [update_room.detected(kind)],
        update_room.robot_in(update_room.changed_home(kind)),
        update_room.UPDATE,
        detector=ChangeDetector(gaussian_map, change_room.CONFIG, cameras=cameras),
        first_id=first_id,
    )


@pytest.mark.parametrize("kind", ["removal", "addition"])
def test_same_update_as_in_a_small_map(kind):
    large, (small, _) = large_map(), change_room.mapped()
    assert large.bounds is not None
    first_id = int(large.ids[-1]) + 1
    in_large, in_small = update(large, kind, first_id), update(small, kind, first_id)
    assert in_large.rejected is None
    assert in_large.part.size < 0.2 * large.size, "it reads a part of the map"
    rows = np.isin(in_large.gaussian_map.ids, in_small.gaussian_map.ids)
    for name in ("ids", "means", "quats", "log_scales", "logit_opacities", "sh"):
        ours, theirs = (getattr(r.gaussian_map, name) for r in (in_large, in_small))
        np.testing.assert_array_equal(ours[rows], theirs, err_msg=name)
    assert apply_deltas(large, [in_large.delta]).size == in_large.gaussian_map.size
    far = large.means[:, 0] > FAR_M / 2
    assert np.isin(large.ids[far], in_large.gaussian_map.ids).all(), "the copies are untouched"


def test_same_update_of_a_map_that_is_read_in_blocks(tmp_path):
    large = large_map()
    MapStore.create(tmp_path, large, MappingCause(dataset="room"))
    with MapStore(tmp_path) as store:
        stored = store.read()
    in_memory, in_blocks = (update(m, "removal", large.next_id) for m in (large, stored))
    assert in_blocks.rejected is None
    assert stored.chunks is not None
    assert_same(in_blocks.part, in_memory.part)
    np.testing.assert_array_equal(in_blocks.delta.removed, in_memory.delta.removed)
    assert_same(in_blocks.gaussian_map, in_memory.gaussian_map)
