"""Whether what was detected is what happened."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from gslts_bench.detection.run import Record, Report
from gslts_sim.task import Change

REGION_M = 1.0
"""A report is in the region of a change if it is as near to the middle of the object's box."""
SIZES_PX = (500, 2000, 8000)
"""Where the table of sizes begins a new row."""
NONE, UNRELIABLE = "none", "unreliable"


def in_region(report: Report, change: Change) -> bool:
    """Whether a report points at where the object was or is."""
    boxes = [np.array(box) for box in (change.box_before, change.box_after) if box is not None]
    middles = np.stack([box.mean(axis=0) for box in boxes])
    metres = np.linalg.norm(middles - np.array(report.point_m), axis=1)
    return bool(metres.min() <= REGION_M)


def fits(report: Report, change: Change) -> bool:
    """Whether a report tells a change: its type, and its region."""
    return report.kind == change.kind and in_region(report, change)


def most_matched(reports: Sequence[Report], changes: Sequence[Change]) -> int:
    """How many changes can be given a report that fits, each report to one change."""
    if not changes:
        return 0
    first, rest = changes[0], changes[1:]
    best = most_matched(reports, rest)
    for k, report in enumerate(reports):
        if fits(report, first):
            best = max(best, 1 + most_matched([*reports[:k], *reports[k + 1 :]], rest))
    return best


@dataclass(frozen=True)
class SingleScore:
    """How one frame with one change was judged.

    Attributes:
        kind: Of the change.
        said: Type of the most certain report, `NONE` or `UNRELIABLE`.
        right: Type and region of the most certain report are.
        region: Its region is.
        found: Any report fits.
        extra: Reports beside the one that may fit.
        size_px: Of the object.
        object_type: Of the object.
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
        """That of a record without error, of a single change."""
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
    """How frames with several changes were judged, all together.

    Attributes:
        changes: That happened.
        found: Of them.
        false: Reports that tell none.
        frames: How many.
    """

    changes: int
    found: int
    false: int
    frames: int

    @classmethod
    def of(cls, records: Iterable[Record]) -> SeveralScore:
        """That of records without errors."""
        changes = found = reported = frames = 0
        for record in records:
            frames += 1
            changes += len(record.truths)
            reported += len(record.reports)
            found += most_matched(record.reports, [truth.change for truth in record.truths])
        return cls(changes, found, reported - found, frames)


def is_right(record: Record) -> bool:
    """Whether a record without error tells all that happened, and in single changes first."""
    if record.part == "single":
        return SingleScore.of(record).right
    score = SeveralScore.of([record])
    return score.found == score.changes and score.false == 0


def size_name(size_px: int) -> str:
    """The row of a size in tables."""
    below = [edge for edge in SIZES_PX if edge <= size_px]
    above = [edge for edge in SIZES_PX if edge > size_px]
    if not below:
        return f"below {above[0]} px"
    return f"{below[-1]} to {above[0]} px" if above else f"from {below[-1]} px"


SIZE_NAMES = tuple(size_name(edge) for edge in (0, *SIZES_PX))
