"""Tracks of objects: one object is one track, and each of its changes is listed once."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest
from store_maps import ROOM, random_map

from gslts.store.causes import Appearance, Box, ChangeRecord, UpdateCause
from gslts.store.describe import describe_versions
from gslts.store.map_store import MapStore
from gslts.store.records import ObjectEvent, Track

A, B, C, D = (1.0, 1.0, 0.5), (3.0, 1.0, 0.5), (1.0, 4.0, 0.5), (4.0, 4.0, 0.5)
"""Positions, m."""
RED, BLUE = "001ff", "900ff"
"""Histograms of one bin."""

Told = list[tuple[str, list[tuple[str, int]]]]
"""Names of tracks, and kind and version of their events."""


def box(centre: tuple[float, float, float], size_m: float = 0.3) -> Box:
    """Return a cube."""
    x, y, z = centre
    half = size_m / 2
    return (x - half, y - half, z - half), (x + half, y + half, z + half)


def came(at: tuple[float, float, float], name: str = "Pillow") -> ObjectEvent:
    """Return an addition."""
    return ObjectEvent(kind="addition", type=name, boxes=(None, box(at)))


def gone(at: tuple[float, float, float], name: str = "Pillow") -> ObjectEvent:
    """Return a removal."""
    return ObjectEvent(kind="removal", type=name, boxes=(box(at), None))


def moved(
    at: tuple[float, float, float], to: tuple[float, float, float], name: str = "Pillow"
) -> ObjectEvent:
    """Return a relocation."""
    return ObjectEvent(kind="relocation", type=name, boxes=(box(at), box(to)))


@pytest.fixture
def store(tmp_path: Path) -> Iterator[MapStore]:
    """Return a map with one version."""
    MapStore.create(tmp_path, random_map(5), ROOM)
    with MapStore(tmp_path, writable=True) as store:
        yield store


def commit(
    store: MapStore, number_of_round: int | None, *events: ObjectEvent, colors: str | None = None
) -> None:
    """Add a version that shows object changes, all of one colour."""
    look = None if colors is None else Appearance(area_m2=0.04, colors=colors)
    changes = tuple(
        ChangeRecord(kind=event.kind, confidence=0.9, boxes=event.boxes, appearances=(look, look))
        for event in events
    )
    store.commit(store.read(), UpdateCause(round=number_of_round, changes=changes), events)


def told(tracks: Sequence[Track]) -> Told:
    """Return what tracks tell."""
    return [
        (track.name, [(event.kind, event.version) for event in track.events]) for track in tracks
    ]


def test_an_object_comes_moves_and_goes(store: MapStore) -> None:
    commit(store, 0, came(A))
    commit(store, 1, moved(A, B))
    commit(store, 2, gone(B))
    assert told(store.tracks()) == [
        ("Pillow", [("addition", 2), ("relocation", 3), ("removal", 4)])
    ]


def test_an_object_gone_and_found_elsewhere_rounds_later_has_moved(store: MapStore) -> None:
    commit(store, 0, gone(A, "Ottoman"))
    assert told(store.tracks()) == [("Ottoman", [("removal", 2)])]
    commit(store, 5, came(B, "Ottoman"))
    (track,) = store.tracks()
    (event,) = track.events
    assert (event.kind, event.version, event.parts) == ("relocation", 3, (2, 3))
    assert event.boxes == (box(A), box(B))
    assert describe_versions(store) == {
        1: [],
        2: ["Ottoman: see version 3"],
        3: ["Ottoman moved from (1.00, 1.00, 0.50) m to (3.00, 1.00, 0.50) m"],
    }


def test_the_new_position_may_be_found_first(store: MapStore) -> None:
    commit(store, 3, came(B, "Ottoman"))
    commit(store, 3, came(C, "Statue"))
    commit(store, 4, gone(A, "Ottoman"))
    assert told(store.tracks()) == [
        ("Ottoman", [("relocation", 4)]),
        ("Statue", [("addition", 3)]),
    ]


def test_an_object_that_goes_long_after_another_came_is_another_one(store: MapStore) -> None:
    commit(store, 0, came(B))
    commit(store, 2, gone(A))
    assert told(store.tracks()) == [("Pillow", [("addition", 2)]), ("Pillow 2", [("removal", 3)])]


def test_an_object_that_comes_back_to_its_position_has_not_moved(store: MapStore) -> None:
    commit(store, 0, gone(A))
    commit(store, 3, came(A))
    assert told(store.tracks()) == [("Pillow", [("removal", 2), ("addition", 3)])]


def test_two_equal_objects_are_two_tracks(store: MapStore) -> None:
    commit(store, 0, came(A))
    commit(store, 1, came(B))
    commit(store, 2, moved(A, C))
    commit(store, 3, gone(B))
    commit(store, 4, came(D))
    assert told(store.tracks()) == [
        ("Pillow", [("addition", 2), ("relocation", 4)]),
        ("Pillow 2", [("addition", 3), ("relocation", 6)]),
    ]


def test_of_two_objects_that_are_gone_the_one_of_the_same_colour_is_found(store: MapStore) -> None:
    commit(store, 0, gone(A), colors=RED)
    commit(store, 0, gone(B), colors=BLUE)
    commit(store, 1, came(C), colors=RED)
    assert told(store.tracks()) == [
        ("Pillow", [("relocation", 4)]),
        ("Pillow 2", [("removal", 3)]),
    ]


def test_objects_without_a_name_are_told_apart_by_colour_and_size(store: MapStore) -> None:
    commit(store, 0, gone(A, "object"), colors=RED)
    commit(store, 0, came(B, "object"), colors=BLUE)
    commit(store, 1, came(C, "object"), colors=RED)
    assert told(store.tracks()) == [
        ("object", [("relocation", 4)]),
        ("object 2", [("addition", 3)]),
    ]


def test_a_change_that_is_reported_again_is_told_once(store: MapStore) -> None:
    near = (A[0] + 0.1, A[1], A[2])
    commit(store, 0, came(A))
    commit(store, 4, came(near))
    commit(store, 5, gone(A))
    commit(store, 5, gone(near))
    (track,) = store.tracks()
    assert [(event.kind, event.parts) for event in track.events] == [
        ("addition", (2, 3)),
        ("removal", (4, 5)),
    ]
    assert describe_versions(store)[5] == ["Pillow: see version 4"]


def test_parts_of_an_object_are_one_object(store: MapStore) -> None:
    commit(store, 0, gone((2.0, 2.0, 1.4), "FloorLamp"))
    commit(store, 0, gone((2.1, 1.9, 0.1), "FloorLamp"))
    assert told(store.tracks()) == [("FloorLamp", [("removal", 2)])]


def test_a_relocation_joins_ends_that_were_reported_before(store: MapStore) -> None:
    commit(store, 0, gone(A))
    commit(store, 0, moved(A, B))
    commit(store, 1, came(D, "Book"))
    commit(store, 1, moved(C, D, "Book"))
    assert told(store.tracks()) == [("Pillow", [("relocation", 3)]), ("Book", [("relocation", 5)])]


def test_a_restored_version_has_the_tracks_of_its_lineage(store: MapStore) -> None:
    commit(store, 0, gone(A))
    commit(store, 1, came(B))
    store.restore(2)
    assert told(store.tracks()) == [("Pillow", [("removal", 2)])]
    commit(store, 2, came(C))
    assert told(store.tracks()) == [("Pillow", [("relocation", 5)])]
    assert told(store.tracks(3)) == [("Pillow", [("relocation", 3)])]
    assert describe_versions(store) == {
        1: [],
        2: ["Pillow: see version 5"],
        3: ["Pillow moved from (1.00, 1.00, 0.50) m to (3.00, 1.00, 0.50) m, undone since"],
        4: [],
        5: ["Pillow moved from (1.00, 1.00, 0.50) m to (1.00, 4.00, 0.50) m"],
    }


def test_one_object_is_found_by_its_name(store: MapStore) -> None:
    commit(store, 0, came(A), came(B), gone(C, "Mug"))
    assert store.track("pillow 2").events[0].boxes == (None, box(B))
    with pytest.raises(
        ValueError, match="no object Vase has changed; objects that have: Mug, Pillow"
    ):
        store.track("Vase")
