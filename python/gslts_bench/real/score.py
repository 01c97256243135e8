"""Score of reported changes against boxes drawn in the images."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from gslts.change.changes import SIDES, Change, Side
from gslts_bench.real.boxes import BoxPx, Kind, MarkedObject

MIN_IOU = 0.25
"""Minimum intersection over union of the boxes of an object and of a report of it. Half of the 0.5
that is usual in object detection: a report has to name the object, not to outline it."""
MIN_INSIDE = 0.5
"""Minimum share of a report inside an ignored box for it not to be counted."""


@dataclass(frozen=True)
class Report:
    """End of a reported change, or a whole shift.

    Attributes:
        side: "after" for what is new, "before" for what is gone.
        box_px: Box of its region in the pixels of the frame.
        confidence: Probability that the change is real.
        shift: True for a shift: the object is said to stay, a little moved.
    """

    side: Side
    box_px: BoxPx
    confidence: float
    shift: bool = False


def reports_of(change: Change, width: int) -> list[Report]:
    """Return the ends of a change that its frame shows; of a shift one, "after" if it is seen.

    Args:
        change: As detected.
        width: Width of the frame, px.
    """
    is_shift = change.kind == "shift"
    boxes = [(side, change.box_px(side, width)) for side in SIDES]
    ends = [
        Report(side, box, change.confidence, is_shift) for side, box in boxes if box is not None
    ]
    return ends[-1:] if is_shift else ends


def found_objects(objects: Sequence[MarkedObject], reports: Sequence[Report]) -> list[bool]:
    """Return for each object if it was found.

    New ones are found after the change, missing ones before, and nudged ones by a shift.

    Args:
        objects: Of kind "new", "missing" or "nudged".
        reports: Reports in the same image.
    """
    return [
        any(
            _tells(report, marked.kind) and iou(marked.box, report.box_px) >= MIN_IOU
            for report in reports
        )
        for marked in objects
    ]


def other_reports(objects: Sequence[MarkedObject], reports: Sequence[Report]) -> list[Report]:
    """Return the reports of nothing that changed, and shifts of what was not nudged.

    Args:
        objects: All differences marked in the image.
        reports: Reports in the same image.
    """
    return [
        report for report in reports if not any(_explains(marked, report) for marked in objects)
    ]


def iou(a: BoxPx, b: BoxPx) -> float:
    """Return the intersection over union of two boxes, 0 to 1.

    Args:
        a: First box.
        b: Second box.
    """
    common = _area(_intersection(a, b))
    return common / (_area(a) + _area(b) - common) if common else 0.0


def _tells(report: Report, kind: Kind) -> bool:
    """Return whether a report says that an object is new, missing or nudged."""
    if report.shift or kind == "nudged":
        return report.shift and kind == "nudged"
    return report.side == {"new": "after", "missing": "before"}[kind]


def _explains(marked: MarkedObject, report: Report) -> bool:
    if report.shift and marked.kind in ("new", "missing"):
        return False
    if iou(marked.box, report.box_px) >= MIN_IOU:
        return True
    inside = _area(_intersection(marked.box, report.box_px)) / max(1.0, _area(report.box_px))
    return marked.kind == "ignore" and inside >= MIN_INSIDE


def _intersection(a: BoxPx, b: BoxPx) -> BoxPx:
    return max(a[0], b[0]), max(a[1], b[1]), min(a[2], b[2]), min(a[3], b[3])


def _area(box: BoxPx) -> float:
    return max(0.0, box[2] - box[0]) * max(0.0, box[3] - box[1])
