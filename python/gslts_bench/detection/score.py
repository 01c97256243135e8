"""Scores of detections by the changes that happened."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from gslts.core.se3 import rotation_vector
from gslts_bench.detection.run import Record, Report
from gslts_sim.task import Change

REGION_M = 1.0
"""Maximum distance of a report from the centre of the changed object's box."""
SHIFT_M = 0.03
"""Maximum error of the motion of a shift that is right, at the centre of the object's box, m."""
SIZES_PX = (500, 2000, 8000)
"""Edges between the rows of the table of object sizes."""
NONE, UNRELIABLE = "none", "unreliable"
"""Types in the table of reports besides those of changes."""


def in_region(report: Report, change: Change) -> bool:
    """Return whether a report is near where the object of a change was or is.

    Args:
        report: A report.
        change: The change.
    """
    boxes = [np.array(box) for box in (change.box_before, change.box_after) if box is not None]
    middles = np.stack([box.mean(axis=0) for box in boxes])
    metres = np.linalg.norm(middles - np.array(report.point_m), axis=1)
    return bool(metres.min() <= REGION_M)


def fits(report: Report, change: Change) -> bool:
    """Return whether type and region of a report are those of a change.

    Args:
        report: A report.
        change: The change.
    """
    return report.kind == change.kind and in_region(report, change)


def count_matches(reports: Sequence[Report], changes: Sequence[Change]) -> int:
    """Count changes with a report that fits, each report used once, in the best assignment.

    Args:
        reports: Reports of one frame.
        changes: Changes in view.
    """
    if not changes:
        return 0
    first, rest = changes[0], changes[1:]
    best = count_matches(reports, rest)
    for k, report in enumerate(reports):
        if fits(report, first):
            best = max(best, 1 + count_matches([*reports[:k], *reports[k + 1 :]], rest))
    return best


@dataclass(frozen=True)
class SingleScore:
    """Score of a frame with one change.

    Attributes:
        kind: Type of the change.
        said: Type of the most confident report, `NONE` or `UNRELIABLE`.
        right: Whether type and region of the most confident report are right.
        region: Whether its region is right.
        found: Whether any report fits.
        extra: Number of reports besides the one that fits.
        size_px: Size of the object in view.
        object_type: Type of the object.
    """

    kind: str
    said: str
    right: bool
    region: bool
    found: bool
    extra: int
    size_px: int
    object_type: str

    @classmethod
    def of(cls, record: Record) -> SingleScore:
        """Score the record of a single change.

        Args:
            record: Record without error.
        """
        (truth,) = record.truths
        change, reports = truth.change, record.reports
        found = any(fits(report, change) for report in reports)
        said = reports[0].kind if reports else NONE
        return cls(
            kind=change.kind,
            said=said if record.unreliable is None else UNRELIABLE,
            right=bool(reports) and fits(reports[0], change),
            region=bool(reports) and in_region(reports[0], change),
            found=found,
            extra=len(reports) - found,
            size_px=truth.size_px,
            object_type=change.object_type,
        )


@dataclass(frozen=True)
class SeveralScore:
    """Score of all frames with several changes.

    Attributes:
        changes: Number of changes.
        found: Number of changes with a report that fits.
        false: Number of reports that fit no change.
        frames: Number of frames.
    """

    changes: int
    found: int
    false: int
    frames: int

    @classmethod
    def of(cls, records: Iterable[Record]) -> SeveralScore:
        """Score records.

        Args:
            records: Records without error.
        """
        changes = found = reported = frames = 0
        for record in records:
            frames += 1
            changes += len(record.truths)
            reported += len(record.reports)
            found += count_matches(record.reports, [truth.change for truth in record.truths])
        return cls(changes, found, reported - found, frames)


@dataclass(frozen=True)
class ShiftScore:
    """Score of a frame in which an object was shifted.

    Attributes:
        said: Type of the report of it, `NONE` or `UNRELIABLE`: of reports in its region, a shift
            counts before others, the nearest shift, and of others the most confident one.
        error_m: Error of the motion of a shift, at the centre of the object's box; None of others.
        error_deg: Error of its rotation, degrees.
        extra: Number of reports besides the shift.
    """

    said: str
    error_m: float | None
    error_deg: float | None
    extra: int

    @classmethod
    def of(cls, record: Record) -> ShiftScore:
        """Score the record of a shift.

        Args:
            record: Record without error.
        """
        (truth,) = record.truths
        change, true = truth.change, np.array(truth.motion)
        assert change.box_before is not None
        center = np.append(np.mean(change.box_before, axis=0), 1.0)
        near = [report for report in record.reports if in_region(report, change)]
        shifts = [report for report in near if report.kind == "shift"]
        if not shifts:
            said = near[0].kind if near else NONE
            said = said if record.unreliable is None else UNRELIABLE
            return cls(said, None, None, len(record.reports))
        nearest = min(shifts, key=lambda shift: np.linalg.norm(shift.point_m - center[:3]))
        motion = np.array(nearest.motion)
        turn_rad = np.linalg.norm(rotation_vector(motion[:3, :3].T @ true[:3, :3]))
        return cls(
            said="shift",
            error_m=float(np.linalg.norm((motion - true) @ center)),
            error_deg=float(np.rad2deg(turn_rad)),
            extra=len(record.reports) - 1,
        )

    @property
    def right(self) -> bool:
        """Return whether the shift was reported, with its motion."""
        return self.error_m is not None and self.error_m <= SHIFT_M


def count_reported_as_shift(record: Record) -> int:
    """Count the changes of a record that a shift is reported of, and nothing that fits.

    Args:
        record: Record without error, without shifted objects.
    """
    changes = [truth.change for truth in record.truths]
    return sum(
        not any(fits(report, change) for report in record.reports)
        and any(report.kind == "shift" and in_region(report, change) for report in record.reports)
        for change in changes
    )


CONFIDENCE_EDGES = (0.0, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)
"""Edges of the groups of confidences that are compared with the share of true reports."""


@dataclass(frozen=True)
class Calibration:
    """Reports by confidence, in the groups of `CONFIDENCE_EDGES`.

    Attributes:
        reports: [G] number of reports in each group.
        true: [G] number of those that fit a change.
        confidence: [G] sum of their confidences.
    """

    reports: tuple[int, ...]
    true: tuple[int, ...]
    confidence: tuple[float, ...]

    @classmethod
    def of(cls, records: Iterable[Record]) -> Calibration:
        """Group the reports of all records.

        Args:
            records: Records without error.
        """
        pairs = [
            (report.confidence, any(fits(report, truth.change) for truth in record.truths))
            for record in records
            for report in record.reports
        ]
        confidences = np.array([confidence for confidence, _ in pairs])
        true = np.array([is_true for _, is_true in pairs], np.float64)
        groups = np.digitize(confidences, CONFIDENCE_EDGES[1:-1])
        sums = [
            np.bincount(groups, weights, len(CONFIDENCE_EDGES) - 1)
            for weights in (None, true, confidences)
        ]
        reports, fitting, confidence = (values.tolist() for values in sums)
        return cls(tuple(reports), tuple(map(int, fitting)), tuple(confidence))

    @property
    def error(self) -> float | None:
        """Expected calibration error (Guo et al. 2017); None without a report.

        It is the mean difference of confidence and share of true reports in a group, weighted by
        the number of reports.
        """
        if not sum(self.reports):
            return None
        differences = np.abs(np.subtract(self.confidence, self.true))
        return float(differences.sum() / sum(self.reports))


def is_right(record: Record) -> bool:
    """Return whether a record has all changes and no others; of one change, whether it is first.

    Args:
        record: Record without error.
    """
    if record.part == "single":
        return SingleScore.of(record).right
    if record.part == "shifted":
        shift = ShiftScore.of(record)
        return shift.right and shift.extra == 0
    score = SeveralScore.of([record])
    return score.found == score.changes and score.false == 0


def size_name(size_px: int) -> str:
    """Return the row of an object's size in tables.

    Args:
        size_px: Pixels of the object.
    """
    below = [edge for edge in SIZES_PX if edge <= size_px]
    above = [edge for edge in SIZES_PX if edge > size_px]
    if not below:
        return f"below {above[0]} px"
    return f"{below[-1]} to {above[0]} px" if above else f"from {below[-1]} px"


SIZE_NAMES = tuple(size_name(edge) for edge in (0, *SIZES_PX))
"""Rows of the table of object sizes."""
