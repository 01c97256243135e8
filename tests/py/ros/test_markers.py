"""Changes as markers: what RViz draws of each kind, labels, and that messages are bounded."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from gslts.change.changes import Change
from gslts.store.records import Track, TrackEvent

REASON = "needs the messages of ROS: scripts/setup ros"
markers = pytest.importorskip("gslts.ros.markers", reason=REASON)
shown = pytest.importorskip("gslts.ros.shown_change", reason=REASON)

LOW, HIGH = ((0.0, 0.0, 0.0), (0.2, 0.4, 0.6)), ((1.0, 2.0, 0.5), (1.2, 2.4, 1.1))
STAY = ((1.0, 0.0, 0.0, 0.05), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0))


def track(name: str, *events: tuple[str, Any, Any], first: int = 2) -> Track:
    """Return the history of an object with an event per version."""
    return Track(
        name=name,
        events=tuple(
            TrackEvent(
                kind=kind,
                type=name,
                boxes=(before, after),
                motion=STAY if kind == "shift" else None,
                version=version,
                parts=(version,),
            )
            for version, (kind, before, after) in enumerate(events, first)
        ),
    )


def drawn(tracks: Sequence[Track]) -> list[Any]:
    """Return the markers after the first, which deletes all others."""
    message = markers.change_markers("map", shown.published_changes(tracks))
    clear, *others = message.markers
    assert clear.action == markers.Marker.DELETEALL
    assert all(marker.action == markers.Marker.ADD for marker in others)
    assert all(marker.header.frame_id == "map" for marker in message.markers)
    keys = [(marker.ns, marker.id) for marker in others]
    assert len(set(keys)) == len(keys)
    return others


def rgb(marker: Any) -> tuple[float, float, float]:
    return marker.color.r, marker.color.g, marker.color.b


def of_type(found: Sequence[Any], kind: str) -> list[Any]:
    return [marker for marker in found if marker.type == getattr(markers.Marker, kind)]


def xyz(vector: Any) -> tuple[float, float, float]:
    return vector.x, vector.y, vector.z


@pytest.mark.parametrize(
    ("kind", "boxes", "colors", "word", "arrows"),
    [
        ("addition", (None, HIGH), ["CAME"], "came", 0),
        ("removal", (LOW, None), ["GONE"], "gone", 0),
        ("relocation", (LOW, HIGH), ["LEFT", "MOVED"], "moved", 1),
        ("shift", (LOW, HIGH), ["SHIFTED"], "shifted", 1),
        ("relocation", (LOW, None), ["LEFT"], "moved", 0),
    ],
)
def test_each_kind_has_its_boxes_and_label(
    kind: str, boxes: tuple[Any, Any], colors: list[str], word: str, arrows: int
) -> None:
    found = drawn([track("Mug", (kind, *boxes))])
    assert [rgb(box) for box in of_type(found, "CUBE")] == [
        getattr(markers, name) for name in colors
    ]
    (label,) = of_type(found, "TEXT_VIEW_FACING")
    assert label.text == f"Mug {word}"
    assert len(of_type(found, "ARROW")) == arrows
    assert all(marker.color.a > 0 for marker in found)


def test_the_box_and_its_edges_are_those_of_the_object() -> None:
    found = drawn([track("Mug", ("addition", None, HIGH))])
    (box,) = of_type(found, "CUBE")
    assert xyz(box.pose.position) == pytest.approx((1.1, 2.2, 0.8))
    assert xyz(box.scale) == pytest.approx((0.2, 0.4, 0.6))
    assert box.pose.orientation.w == 1
    (edges,) = of_type(found, "LINE_LIST")
    ends = np.array([xyz(point) for point in edges.points]).reshape(-1, 2, 3)
    lengths = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    np.testing.assert_allclose(sorted(lengths), np.repeat([0.2, 0.4, 0.6], 4))
    corners = np.unique(ends.reshape(-1, 3).round(6), axis=0)
    assert len(corners) == 8
    np.testing.assert_allclose([corners.min(axis=0), corners.max(axis=0)], HIGH)
    (label,) = of_type(found, "TEXT_VIEW_FACING")
    assert label.pose.position.z > 1.1


def test_an_arrow_leads_from_the_old_position_to_the_new() -> None:
    (arrow,) = of_type(drawn([track("Mug", ("relocation", LOW, HIGH))]), "ARROW")
    start, end = (xyz(point) for point in arrow.points)
    assert start == pytest.approx((0.1, 0.2, 0.3))
    assert end == pytest.approx((1.1, 2.2, 0.8))


def test_an_object_is_shown_by_its_last_change() -> None:
    came_and_left = track("Mug", ("addition", None, LOW), ("removal", LOW, None))
    found = drawn([came_and_left])
    assert [rgb(box) for box in of_type(found, "CUBE")] == [markers.GONE]


def test_ids_stay_when_other_objects_change() -> None:
    mug = track("Mug", ("addition", None, LOW))
    before = {(marker.ns, marker.id) for marker in drawn([mug])}
    after = {
        (marker.ns, marker.id) for marker in drawn([track("Box", ("removal", LOW, None)), mug])
    }
    assert before < after


def test_only_the_newest_changes_are_shown() -> None:
    many = [track(f"Cup {n}", ("addition", None, LOW), first=n) for n in range(1, 200)]
    names = {marker.ns for marker in drawn(many)}
    assert names == {f"Cup {n}" for n in range(200 - shown.MAX_CHANGES, 200)}
    long = track("x" * 10_000, ("addition", None, LOW))
    (label,) = of_type(drawn([long]), "TEXT_VIEW_FACING")
    assert len(label.text) < 100


def test_detected_changes_are_faint_and_show_their_confidence() -> None:
    low, high = (np.array(corner) for corner in HIGH)
    change = Change("addition", 0.87, (low + high) / 2, boxes=(None, (low, high)))
    message = markers.change_markers("map", shown.detected_changes([change]))
    (box,) = of_type(message.markers[1:], "CUBE")
    assert box.color.a < markers.ALPHA
    (label,) = of_type(message.markers[1:], "TEXT_VIEW_FACING")
    assert label.text == "object 1 came? 87 %"


def test_a_change_without_boxes_and_a_flat_one() -> None:
    unknown = Change("removal", 0.9, np.zeros(3))
    message = markers.change_markers("map", shown.detected_changes([unknown]))
    assert len(message.markers) == 1
    flat = ((0.0, 0.0, 0.5), (1.0, 1.0, 0.5))
    (box,) = of_type(drawn([track("Rug", ("addition", None, flat))]), "CUBE")
    assert box.scale.z > 0
