"""Score of the changes that several frames of a visit confirm."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from gslts.change.changes import SIDES, Change, Side
from gslts.change.confirmation import MonitorConfig
from gslts.change.constants import MIN_RECORDED_CONFIDENCE
from gslts.change.detection import Detection
from gslts.change.detector import ChangeDetector
from gslts.change.monitor import Counts, confirm_changes
from gslts.core.frame import RgbdFrame
from gslts_bench.real.boxes import JUDGED, MarkedObject
from gslts_bench.real.score import Report, found_objects, other_reports, reports_of

CONFIRMATION = MonitorConfig(needed=1, confidence=MIN_RECORDED_CONFIDENCE)
"""The robots of these visits saw most objects in two frames, and some in one."""
_Place = tuple[Side, tuple[float, ...] | None]
"""A side of a change, and the position there."""


@dataclass(frozen=True, eq=False)
class VisitScore:
    """Changes confirmed over a visit, against the boxes drawn in its images.

    Attributes:
        found: Whether each object that is new, missing or nudged was found, by kind and name.
        others: Confidences of the reports of nothing that changed.
        counts: Numbers of frames.
    """

    found: Mapping[tuple[str, str], bool]
    others: tuple[float, ...]
    counts: Counts


def score_visit(
    detector: ChangeDetector,
    frames: Sequence[RgbdFrame],
    marked: Sequence[Sequence[MarkedObject]],
    config: MonitorConfig = CONFIRMATION,
) -> VisitScore:
    """Confirm changes over the frames of a visit, and judge each in the frame that showed it.

    Args:
        detector: Of the map.
        frames: In the order in which they were taken.
        marked: Differences marked in each frame.
        config: Settings of the confirmation.
    """
    seen_by = _RememberingDetector(detector)
    changes, counts = confirm_changes(seen_by, frames, config)
    found = {_key(o): False for objects in marked for o in objects if _is_judged(o)}
    others: list[float] = []
    confirmed = {_place(change, side) for change in changes for side in SIDES}
    for frame, objects, detection in zip(frames, marked, seen_by.detections, strict=True):
        reports = _take_ends(confirmed, detection, frame.camera.width)
        changed = [o for o in objects if _is_judged(o)]
        for o, is_found in zip(changed, found_objects(changed, reports), strict=True):
            found[_key(o)] |= is_found
        others += [report.confidence for report in other_reports(objects, reports)]
    return VisitScore(found, tuple(others), counts)


class _RememberingDetector(ChangeDetector):
    """A detector that remembers what it detected in each frame."""

    def __init__(self, detector: ChangeDetector) -> None:
        self.config, self._detector = detector.config, detector
        self.detections: list[Detection] = []

    def detect(self, frame: RgbdFrame) -> Detection:
        """Compare a frame with the map; see `ChangeDetector.detect`."""
        self.detections.append(self._detector.detect(frame))
        return self.detections[-1]


def _take_ends(confirmed: set[_Place], detection: Detection, width: int) -> list[Report]:
    """Remove the ends of confirmed changes that were reported as this frame shows them."""
    ends = []
    for change in detection.changes:
        for report in reports_of(change, width):
            place = _place(change, report.side)
            if place in confirmed:
                confirmed.remove(place)
                ends.append(report)
    return ends


def _place(change: Change, side: Side) -> _Place:
    point = change.end_point(side)
    return side, None if point is None else tuple(point)


def _key(marked: MarkedObject) -> tuple[str, str]:
    return marked.kind, marked.name


def _is_judged(marked: MarkedObject) -> bool:
    return marked.kind in JUDGED
