"""Versions that a version was made from, and what came with them."""

from pathlib import Path

from store_maps import ROOM, addition, edited, random_map

from gslts.store.causes import UpdateCause
from gslts.store.map_store import MapStore
from gslts.store.records import ObjectEvent


def test_ids_of_updates_are_those_of_the_lineage(tmp_path: Path) -> None:
    MapStore.create(tmp_path, random_map(100), ROOM)
    with MapStore(tmp_path, writable=True) as store:
        first = store.version().next_id
        assert store.updates().added_ids == []
        for seed, cause in enumerate((UpdateCause(), ROOM, UpdateCause())):
            store.commit(edited(store.read(), seed, store.version().next_id), cause)
        assert store.version().next_id == first + 21
        expected = [range(first, first + 7), range(first + 14, first + 21)]
        assert store.updates().added_ids == expected
        assert store.updates(1).added_ids == []
        store.restore(1)
        assert store.updates().added_ids == []


def test_boxes_that_objects_left_are_those_of_the_lineage(tmp_path: Path) -> None:
    low, high = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
    gone = ObjectEvent(kind="removal", type="Mug", boxes=((low, high), None))
    MapStore.create(tmp_path, random_map(100), ROOM)
    with MapStore(tmp_path, writable=True) as store:
        store.commit(store.read(), UpdateCause(), [addition("Book"), gone])
        assert store.updates().left == [(low, high)]
        assert store.updates(1).left == []
        store.restore(1)
        assert store.updates().left == []


def test_object_changes_between_versions_follow_the_lineage(tmp_path: Path) -> None:
    MapStore.create(tmp_path, random_map(100), ROOM)
    with MapStore(tmp_path, writable=True) as store:
        store.commit(store.read(), UpdateCause(), [addition("Mug")])
        store.restore(1)
        store.commit(store.read(), UpdateCause(), [addition("Book")])

        def types(before: int, after: int) -> list[list[str]]:
            sides = store.changes_between(before, after)
            return [[event.type for _, event in changes] for changes in sides]

        assert types(1, 2) == [["Mug"], []]
        assert types(2, 1) == [[], ["Mug"]]
        assert types(1, 3) == [[], []]
        assert types(2, 4) == [["Book"], ["Mug"]]
        assert [version.number for version in store.lineage(4)] == [1, 3, 4]
