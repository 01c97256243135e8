"""Tracks of objects: one object is one track, and each of its changes is listed once."""

import json
import math
from collections.abc import Iterator, Sequence
from datetime import datetime
from pathlib import Path

import pytest
from store_maps import ORACLE, ROOM, random_map

from gslts.store.causes import Appearance, Box, ChangeRecord, Motion, UpdateCause
from gslts.store.describe import describe_event, describe_versions, version_facts
from gslts.store.map_store import MapStore
from gslts.store.records import ObjectEvent, Track

A, B, C, D = (1.0, 1.0, 0.5), (3.0, 1.0, 0.5), (1.0, 4.0, 0.5), (4.0, 4.0, 0.5)
"""Positions, m."""
RED, BLUE = "001ff", "900ff"
"""Histograms of one bin."""

EventNames = list[tuple[str, list[tuple[str, int]]]]
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


def shifted(
    at: tuple[float, float, float], motion: Motion, name: str = "Table", size_m: float = 0.8
) -> ObjectEvent:
    """Return a shift, of which the frame shows boxes of this size."""
    to = tuple(sum(a * b for a, b in zip(row, (*at, 1), strict=True)) for row in motion[:3])
    boxes = (box(at, size_m), box(to, size_m))
    return ObjectEvent(kind="shift", type=name, boxes=boxes, motion=motion)


def motion(dx: float, dy: float, degrees: float = 0, about: tuple[float, float] = (0, 0)) -> Motion:
    """Return a motion over the floor: a rotation about a vertical axis, then a translation."""
    cosine, sine = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    x, y = about
    return (
        (cosine, -sine, 0.0, dx + x - cosine * x + sine * y),
        (sine, cosine, 0.0, dy + y - sine * x - cosine * y),
        (0.0, 0.0, 1.0, 0.0),
        (0.0, 0.0, 0.0, 1.0),
    )


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
    appearance = None if colors is None else Appearance(colors=colors)
    changes = tuple(
        ChangeRecord(
            kind=event.kind,
            confidence=0.9,
            boxes=event.boxes,
            appearances=(appearance, appearance),
            motion=event.motion,
        )
        for event in events
    )
    store.commit(store.read(), UpdateCause(round=number_of_round, changes=changes), events)


def events_by_object(tracks: Sequence[Track]) -> EventNames:
    """Return what tracks tell."""
    return [
        (track.name, [(event.kind, event.version) for event in track.events]) for track in tracks
    ]


def test_an_object_comes_moves_and_goes(store: MapStore) -> None:
    commit(store, 0, came(A))
    commit(store, 1, moved(A, B))
    commit(store, 2, gone(B))
    assert events_by_object(store.tracks()) == [
        ("Pillow", [("addition", 2), ("relocation", 3), ("removal", 4)])
    ]


def test_an_object_gone_and_found_elsewhere_rounds_later_has_moved(store: MapStore) -> None:
    commit(store, 0, gone(A, "Ottoman"))
    assert events_by_object(store.tracks()) == [("Ottoman", [("removal", 2)])]
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
    assert events_by_object(store.tracks()) == [
        ("Ottoman", [("relocation", 4)]),
        ("Statue", [("addition", 3)]),
    ]


def test_an_object_that_goes_long_after_another_came_is_another_one(store: MapStore) -> None:
    commit(store, 0, came(B))
    commit(store, 2, gone(A))
    assert events_by_object(store.tracks()) == [
        ("Pillow", [("addition", 2)]),
        ("Pillow 2", [("removal", 3)]),
    ]


def test_an_object_that_comes_back_to_its_position_has_not_moved(store: MapStore) -> None:
    commit(store, 0, gone(A))
    commit(store, 3, came(A))
    assert events_by_object(store.tracks()) == [("Pillow", [("removal", 2), ("addition", 3)])]


def test_two_equal_objects_are_two_tracks(store: MapStore) -> None:
    commit(store, 0, came(A))
    commit(store, 1, came(B))
    commit(store, 2, moved(A, C))
    commit(store, 3, gone(B))
    commit(store, 4, came(D))
    assert events_by_object(store.tracks()) == [
        ("Pillow", [("addition", 2), ("relocation", 4)]),
        ("Pillow 2", [("addition", 3), ("relocation", 6)]),
    ]


def test_of_two_objects_that_are_gone_the_one_of_the_same_colour_is_found(store: MapStore) -> None:
    commit(store, 0, gone(A), colors=RED)
    commit(store, 0, gone(B), colors=BLUE)
    commit(store, 1, came(C), colors=RED)
    assert events_by_object(store.tracks()) == [
        ("Pillow", [("relocation", 4)]),
        ("Pillow 2", [("removal", 3)]),
    ]


def test_objects_without_a_name_are_distinguished_by_colour_and_size(store: MapStore) -> None:
    commit(store, 0, gone(A, "object"), colors=RED)
    commit(store, 0, came(B, "object"), colors=BLUE)
    commit(store, 1, came(C, "object"), colors=RED)
    assert events_by_object(store.tracks()) == [
        ("object", [("relocation", 4)]),
        ("object 2", [("addition", 3)]),
    ]


def test_a_change_that_is_reported_again_is_one_event(store: MapStore) -> None:
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
    assert events_by_object(store.tracks()) == [("FloorLamp", [("removal", 2)])]


def test_a_relocation_joins_ends_that_were_reported_before(store: MapStore) -> None:
    commit(store, 0, gone(A))
    commit(store, 0, moved(A, B))
    commit(store, 1, came(D, "Book"))
    commit(store, 1, moved(C, D, "Book"))
    assert events_by_object(store.tracks()) == [
        ("Pillow", [("relocation", 3)]),
        ("Book", [("relocation", 5)]),
    ]


def test_a_restored_version_has_the_tracks_of_its_lineage(store: MapStore) -> None:
    commit(store, 0, gone(A))
    commit(store, 1, came(B))
    store.restore(2)
    assert events_by_object(store.tracks()) == [("Pillow", [("removal", 2)])]
    commit(store, 2, came(C))
    assert events_by_object(store.tracks()) == [("Pillow", [("relocation", 5)])]
    assert events_by_object(store.tracks(3)) == [("Pillow", [("relocation", 3)])]
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


def test_a_shift_is_one_event_and_the_object_stays(store: MapStore) -> None:
    commit(store, 0, came(A, "Table"), colors=RED)
    commit(store, 3, shifted(A, motion(0.07, 0, 3, about=A[:2])), colors=BLUE)
    commit(store, 6, shifted((1.07, 1.0, 0.5), motion(0, -0.1)))
    commit(store, 9, gone((1.07, 0.9, 0.5), "Table"), colors=RED)
    assert events_by_object(store.tracks()) == [
        ("Table", [("addition", 2), ("shift", 3), ("shift", 4), ("removal", 5)])
    ]
    lines = describe_versions(store)
    assert lines[3] == ["Table shifted by 7 cm and 3°"]
    assert lines[4] == ["Table shifted by 10 cm and 0°"]
    assert store.tracks()[0].events[1].motion == motion(0.07, 0, 3, about=A[:2])


def test_a_shifted_object_that_the_first_map_shows_is_one_object(store: MapStore) -> None:
    commit(store, 0, shifted(A, motion(0.08, 0)))
    commit(store, 5, moved((1.08, 1.0, 0.5), B, "Table"))
    assert events_by_object(store.tracks()) == [("Table", [("shift", 2), ("relocation", 3)])]


def test_what_stands_on_a_shifted_object_keeps_its_identity(store: MapStore) -> None:
    mug = (1.3, 1.0, 0.95)
    commit(store, 0, ObjectEvent(kind="addition", type="object", boxes=(None, box(mug, 0.1))))
    for number in range(4):
        at = (1 + 0.12 * number, 1.0, 0.5)
        commit(store, number + 1, shifted(at, motion(0.12, 0), "object"))
    left = ObjectEvent(
        kind="removal", type="object", boxes=(box((mug[0] + 0.48, 1.0, 0.95), 0.1), None)
    )
    commit(store, 9, left)
    assert events_by_object(store.tracks()) == [
        ("object", [("addition", 2), ("removal", 7)]),
        ("object 2", [("shift", version) for version in (3, 4, 5, 6)]),
    ]


def test_a_shift_of_an_unknown_position_has_no_distance() -> None:
    event = ObjectEvent(
        kind="shift", type="Chair", boxes=(None, None), motion=motion(0.1, 0, -4, about=(5, 5))
    )
    assert describe_event(event) == "Chair shifted by 4°"


def test_facts_of_a_version_name_its_words_and_the_last_positions(store: MapStore) -> None:
    commit(store, 0, came(A), gone(C, "Mug"))
    store.commit(store.read(), ORACLE, ())
    commit(store, 1, moved(A, B))
    facts = version_facts(store, None)
    json.dumps(facts, allow_nan=False)
    assert (facts["version"], facts["types"]) == (4, ("Mug",))
    assert facts["objects"] == [{"name": "Mug", "box": None}, {"name": "Pillow", "box": box(B)}]
    time_s = datetime.fromisoformat(facts["time"]).timestamp()
    assert time_s == pytest.approx(store.version(4).time_s, rel=0, abs=1e-6)
    before = version_facts(store, 2)
    assert (before["version"], before["types"]) == (2, ())
    assert before["objects"][1] == {"name": "Pillow", "box": box(A)}
    with pytest.raises(ValueError, match="version 9"):
        version_facts(store, 9)
