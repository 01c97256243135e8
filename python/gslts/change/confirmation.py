"""Confirmation of changes: the same change in enough of the last frames is reported once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from gslts.change.changes import Change
from gslts.change.config import ObjectRule
from gslts.change.rules import relocation_of


@dataclass(frozen=True)
class MonitorConfig:
    """Settings of the confirmation of changes.

    Args:
        rate_hz: Maximum number of frames per second that are compared with the map.
        queue: Maximum number of frames that wait; the oldest are dropped.
        window: Number of last frames that count.
        needed: Number of these frames that must show a change, so that people who walk through
            the view are not reported.
        confidence: Minimum confidence that these frames give together, in [0, 1): the product of
            their odds, as if each erred by itself.
        near_m: Maximum distance of two observations of one change, m.

    Raises:
        ValueError: A setting is out of range.
    """

    rate_hz: float = 2.0
    queue: int = 4
    window: int = 6
    needed: int = 3
    confidence: float = 0.0
    near_m: float = 0.3

    def __post_init__(self) -> None:
        if not (self.rate_hz > 0 and self.queue >= 1 and self.near_m > 0):
            raise ValueError("MonitorConfig: rate_hz, queue and near_m must be positive")
        if not 1 <= self.needed <= self.window:
            raise ValueError(
                f"MonitorConfig: needed must be in 1..{self.window}, got {self.needed}"
            )
        if not 0 <= self.confidence < 1:
            raise ValueError(f"MonitorConfig: confidence must be in [0, 1), got {self.confidence}")


@dataclass(frozen=True, eq=False)
class Report:
    """A confirmed change.

    Attributes:
        number: Number of the report, from 1.
        change: The change as last observed.
        times_s: `RgbdFrame.time_s` of the frames that show it.
        replaces: Number of the report of its other end, if a removal and an addition observed in
            different frames turn out to be one relocation.
    """

    number: int
    change: Change
    times_s: tuple[float, ...]
    replaces: int | None = None


@dataclass(eq=False)
class _Candidate:
    """A change observed in some of the last frames.

    Attributes:
        change: The change as last observed.
        frames: Number, time, s, and confidence of the frames that show it.
        reported: Number of its report; None if there is none yet.
    """

    change: Change
    frames: list[tuple[int, float, float]] = field(default_factory=list)
    reported: int | None = None


class ChangeConfirmation:
    """Matches changes of successive frames and reports those that enough frames show.

    Args:
        config: Settings.
    """

    def __init__(self, config: MonitorConfig) -> None:
        self.config = config
        self._candidates: list[_Candidate] = []
        self._last_number = 0

    def observe(
        self, number: int, time_s: float, changes: Sequence[Change], rule: ObjectRule
    ) -> list[Report]:
        """Match the changes of a frame with candidates, and report those with enough frames.

        Args:
            number: Number of the frame; rises from frame to frame.
            time_s: Time of the frame, s.
            changes: Changes that a detector found in the frame.
            rule: Rule by which a removal and an addition are one relocation.

        Returns:
            Changes that this frame confirms.
        """
        reports = []
        for change, candidate in self._match(changes):
            if candidate.change.kind == change.kind:  # An end tells less than a relocation.
                candidate.change = change
            if not candidate.frames or candidate.frames[-1][0] != number:  # A frame counts once.
                candidate.frames.append((number, time_s, change.confidence))
        first = number - self.config.window + 1
        for candidate in list(self._candidates):
            candidate.frames = [frame for frame in candidate.frames if frame[0] >= first]
            if candidate.reported is None and self._is_confirmed(candidate):
                reports.append(self._report(candidate, rule))
        self._candidates = [
            candidate
            for candidate in self._candidates
            if candidate.frames or candidate.reported is not None
        ]
        return reports

    def forget(self, report: Report) -> None:
        """Forget a reported change: if it is still observed, it will be reported again.

        Args:
            report: Report of the change.
        """
        self._candidates = [
            candidate for candidate in self._candidates if candidate.reported != report.number
        ]

    def forget_all(self) -> None:
        """Forget all observations; reports are still numbered on."""
        self._candidates = []

    def is_pending(self, number: int) -> bool:
        """Return True if a frame shows a change that is not confirmed yet.

        Args:
            number: Number of the frame.
        """
        return any(
            candidate.reported is None and candidate.frames[-1][0] == number
            for candidate in self._candidates
        )

    def _is_confirmed(self, candidate: _Candidate) -> bool:
        if len(candidate.frames) < self.config.needed:
            return False
        confidences = np.array([confidence for _, _, confidence in candidate.frames])
        # Of the product of the odds: p / (p + q).
        true, false = np.prod(confidences), np.prod(1 - confidences)
        return bool(true >= self.config.confidence * (true + false))

    def _report(self, candidate: _Candidate, rule: ObjectRule) -> Report:
        other = self._join(candidate, rule)
        if other is not None:
            self._candidates.remove(other)
        self._last_number += 1
        candidate.reported = self._last_number
        times_s = tuple(time_s for _, time_s, _ in candidate.frames)
        replaces = None if other is None else other.reported
        return Report(self._last_number, candidate.change, times_s, replaces)

    def _join(self, candidate: _Candidate, rule: ObjectRule) -> _Candidate | None:
        """Return the reported end that a candidate includes; make it a relocation if they join."""
        for other in self._candidates:
            if other.reported is None or other is candidate or _share_frame(other, candidate):
                continue
            if self._is_end(other.change, candidate.change):
                return other
            ends = {end.change.kind: end.change for end in (candidate, other)}
            if set(ends) == {"removal", "addition"}:
                whole = relocation_of(ends["removal"], ends["addition"], rule)
                if whole is not None:
                    candidate.change = whole
                    return other
        return None

    def _match(self, changes: Sequence[Change]) -> list[tuple[Change, _Candidate]]:
        """Return the candidate of each change of a frame.

        It is the near one of the same kind whose boxes agree best, or else the nearest one, and
        each candidate has at most one of them, as two objects may stand side by side; or a
        relocation of which the change is an end; or a new one.
        """
        pairs = sorted(
            (
                -candidate.change.box_iou(change),
                float(np.linalg.norm(candidate.change.point - change.point)),
                row,
                column,
            )
            for row, change in enumerate(changes)
            for column, candidate in enumerate(self._candidates)
            if candidate.change.kind == change.kind
        )
        matched: dict[int, _Candidate] = {}
        taken: set[int] = set()
        for _, distance_m, row, column in pairs:
            if distance_m <= self.config.near_m and row not in matched and column not in taken:
                matched[row] = self._candidates[column]
                taken.add(column)
        for row, change in enumerate(changes):
            if row not in matched:
                kinds = ("relocation", change.kind)
                seen = [found for k, found in matched.items() if changes[k].kind in kinds]
                matched[row] = self._whole_of(change, seen) or _Candidate(change)
            if matched[row] not in self._candidates:
                self._candidates.append(matched[row])
        return [(change, matched[row]) for row, change in enumerate(changes)]

    def _whole_of(self, change: Change, seen: Sequence[_Candidate]) -> _Candidate | None:
        """Return a relocation of which a change is an end; None if there is none.

        It is none that the same frame has `seen`, as a relocation or by an end of this kind.
        """
        wholes = (
            candidate
            for candidate in self._candidates
            if candidate not in seen and self._is_end(change, candidate.change)
        )
        return next(wholes, None)

    def _is_end(self, change: Change, whole: Change) -> bool:
        """Test if a change is a removal or an addition that is one end of a relocation."""
        if whole.kind != "relocation" or change.kind not in ("removal", "addition"):
            return False
        end = whole.end_point("before" if change.kind == "removal" else "after")
        return end is not None and float(np.linalg.norm(end - change.point)) <= self.config.near_m


def _share_frame(a: _Candidate, b: _Candidate) -> bool:
    """Test if one frame shows both, so that they are two objects."""
    numbers = {number for number, _, _ in a.frames}
    return any(number in numbers for number, _, _ in b.frames)


def latest_reports(reports: Sequence[Report]) -> list[Report]:
    """Return the reports that no later one replaces.

    Args:
        reports: Reports of one monitor, in their order.
    """
    replaced = {report.replaces for report in reports}
    return [report for report in reports if report.number not in replaced]
