"""Tests of the score on real visits, and of the boxes drawn in them."""

import numpy as np
import pytest

from gslts.change.changes import Change
from gslts_bench.real.boxes import MarkedObject, marked_rooms
from gslts_bench.real.score import Report, found_objects, iou, other_reports, reports_of


def marked(kind: str, *box: float) -> MarkedObject:
    return MarkedObject.model_validate(
        {"kind": kind, "name": "mug", "box_px": list(map(float, box))}
    )


def test_iou_of_boxes() -> None:
    assert iou((0, 0, 10, 10), (0, 0, 10, 10)) == 1
    assert iou((0, 0, 10, 10), (5, 0, 15, 10)) == pytest.approx(1 / 3)
    assert iou((0, 0, 10, 10), (10, 0, 20, 10)) == 0
    assert iou((0, 0, 10, 10), (20, 20, 30, 30)) == 0


def test_an_object_is_found_at_its_side_and_place() -> None:
    mug = marked("new", 100, 100, 140, 140)
    near, far = (105, 100, 145, 140), (200, 100, 240, 140)
    assert found_objects([mug], [Report("after", near, 0.9)]) == [True]
    assert found_objects([mug], [Report("before", near, 0.9)]) == [False]
    assert found_objects([mug], [Report("after", far, 0.9)]) == [False]
    gone = marked("missing", 100, 100, 140, 140)
    assert found_objects([gone], [Report("before", near, 0.9)]) == [True]


def test_reports_of_nothing_are_others() -> None:
    report = Report("after", (100, 100, 120, 120), 0.8)
    assert other_reports([], [report]) == [report]
    assert other_reports([marked("nudged", 100, 100, 125, 120)], [report]) == []
    large = (0, 0, 640, 480)
    assert other_reports([marked("ignore", *large)], [report]) == []
    assert other_reports([marked("new", *large)], [report]) == [report]


def test_a_shift_tells_what_is_nudged_and_nothing_else() -> None:
    box = (100.0, 100.0, 140.0, 140.0)
    shift = Report("after", box, 0.9, shift=True)
    nudged, new, gone = (marked(kind, *box) for kind in ("nudged", "new", "missing"))
    assert found_objects([nudged, new, gone], [shift]) == [True, False, False]
    ends = [Report("after", box, 0.9), Report("before", box, 0.9)]
    assert found_objects([nudged, new, gone], ends) == [False, True, True]
    assert other_reports([nudged], [shift]) == []
    assert other_reports([marked("ignore", *box)], [shift]) == []
    assert other_reports([new, gone], [shift]) == [shift]
    assert other_reports([], [shift]) == [shift]


def test_a_shift_is_one_report() -> None:
    before, after = np.zeros((2, 60, 80), bool)
    before[10:21, 30:35] = True
    shift = Change(
        "shift", 0.9, np.zeros(3), masks=(before, after), motion=np.eye(4, dtype=np.float64)
    )
    assert reports_of(shift, 80) == [Report("before", (30, 10, 35, 21), 0.9, shift=True)]
    after[12:23, 30:35] = True
    assert reports_of(shift, 80) == [Report("after", (30, 12, 35, 23), 0.9, shift=True)]


def test_all_images_of_the_rooms_are_marked() -> None:
    rooms = marked_rooms()
    assert list(rooms) == ["Kitchen", "Office", "SmallRoom"]
    for room, frames in zip(rooms.values(), (6, 4, 8), strict=True):
        assert sorted(room.visits) == [f"scene{k}" for k in range(2, 7)]
        assert all(len(images) == frames for images in room.visits.values())
        boxes = [m.box for v in room.visits.values() for objects in v.values() for m in objects]
        assert all(0 <= x0 < x1 <= 640 and 0 <= y0 < y1 <= 480 for x0, y0, x1, y1 in boxes)


def test_the_box_of_a_change_is_in_pixels_of_the_frame() -> None:
    mask = np.zeros((60, 80), bool)
    mask[10:21, 30:35] = True
    change = Change("addition", 0.9, np.zeros(3), masks=(None, mask))
    assert change.box_px("after", 160) == (60, 20, 70, 42)
    assert change.box_px("before", 160) is None
