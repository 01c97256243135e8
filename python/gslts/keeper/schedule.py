"""Order in which detected changes are integrated, and changes that are deferred to later rounds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from gslts.change.changes import SIDES, Change, Kind
from gslts.change.confirmation import Report
from gslts.types import Floats
from gslts.update.region import Region, regions_of

MAX_GROUP_GAP_M = 1.0
"""Maximum gap between the regions of changes that one update integrates, m. Views of one would also
show the other."""
HALF_WORTH_M = 2.0
"""Distance from the robot at which a change counts half as much, m."""
SAME_CHANGE_M = 0.3
"""Maximum distance between two reports of the same change, m."""
MAX_DELAY_ROUNDS = 16
"""Maximum delay of a deferred change, rounds. The delay doubles with each attempt."""


class DeferredChange(BaseModel):
    """A change that could not be integrated, and is tried again in a later round.

    Attributes:
        kind: Type of the change.
        point: (3,) position in the world frame, m.
        reason: Reason for rejecting the update.
        attempts: Number of updates that were tried.
        retry_round: First round in which it is tried again, if it is still detected.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Kind
    point: tuple[FiniteFloat, FiniteFloat, FiniteFloat]
    reason: str
    attempts: Annotated[int, Field(ge=1)]
    retry_round: Annotated[int, Field(ge=0)]

    def describe(self) -> str:
        """Return the change and the reason in one line."""
        x, y, z = self.point
        return f"deferred: {self.kind} at ({x:.2f}, {y:.2f}, {z:.2f}) m: {self.reason}"

    def matches(self, change: Change) -> bool:
        """Return whether a detected change is this one.

        Args:
            change: As detected.
        """
        distance_m = float(np.linalg.norm(change.point - np.array(self.point)))
        return distance_m <= SAME_CHANGE_M and change.kind == self.kind


def is_same_change(first: Change, second: Change) -> bool:
    """Return whether two reports may be of one change: of one kind, or an end of a relocation.

    Args:
        first: As detected.
        second: As detected.
    """
    near = float(np.linalg.norm(first.point - second.point)) <= SAME_CHANGE_M
    return near and (first.kind == second.kind or "relocation" in (first.kind, second.kind))


def select_changes(waiting: Sequence[Change], position: Floats) -> list[Change]:
    """Select the most confident and nearest change, and those near it.

    Args:
        waiting: At least one.
        position: (2,) position of the robot, x and y in the world frame, m.

    Returns:
        Changes that one update integrates.
    """

    def worth(change: Change) -> float:
        distance_m = float(np.linalg.norm(change.point[:2] - position))
        return change.confidence / (1 + distance_m / HALF_WORTH_M)

    first = max(waiting, key=worth)
    return [
        change for change in waiting if change is first or _gap_m(change, first) <= MAX_GROUP_GAP_M
    ]


def defer(
    deferred: Sequence[DeferredChange], change: Change, reason: str, number_of_round: int
) -> tuple[DeferredChange, ...]:
    """Defer a change.

    Args:
        deferred: Changes that are deferred already.
        change: Change that could not be integrated.
        reason: Reason for rejecting the update.
        number_of_round: Present round.

    Returns:
        All deferred changes.
    """
    others = tuple(other for other in deferred if not other.matches(change))
    attempts = 1 + max((other.attempts for other in deferred if other.matches(change)), default=0)
    delay = min(2 ** (attempts - 1), MAX_DELAY_ROUNDS)
    x, y, z = change.point.tolist()
    new = DeferredChange(
        kind=change.kind,
        point=(x, y, z),
        reason=reason,
        attempts=attempts,
        retry_round=number_of_round + delay,
    )
    return (*others, new)


def still_deferred(
    deferred: Sequence[DeferredChange], integrated: Sequence[Change]
) -> tuple[DeferredChange, ...]:
    """Return the deferred changes that an update did not integrate.

    Args:
        deferred: Deferred changes.
        integrated: Changes that the map shows now.
    """
    return tuple(d for d in deferred if not any(d.matches(change) for change in integrated))


def due_reports(
    deferred: Sequence[DeferredChange], reports: Sequence[Report], number_of_round: int
) -> list[Report]:
    """Return what need not wait for a later round.

    Args:
        deferred: Deferred changes.
        reports: Of confirmed changes.
        number_of_round: Present round.

    Returns:
        Reports of changes that are not deferred; of a relocation with a deferred end, the other.
    """
    due = []
    for report in reports:
        change = _due_part(deferred, report.change, number_of_round)
        if change is not None:
            due.append(replace(report, change=change))
    return due


def _due_part(
    deferred: Sequence[DeferredChange], change: Change, number_of_round: int
) -> Change | None:
    def is_due(part: Change) -> bool:
        return not any(d.matches(part) and d.retry_round > number_of_round for d in deferred)

    if change.kind != "relocation":
        return change if is_due(change) else None
    ends = [change.end(side) for side in SIDES if change.end_point(side) is not None]
    due = [end for end in ends if is_due(end)]
    if len(due) == len(ends):
        return change if is_due(change) else None
    return next(iter(due), None)


def _gap_m(first: Change, second: Change) -> float:
    """Return the distance between the nearest regions of two changes, m."""
    pairs = ((a, b) for a in regions_of(first) for b in regions_of(second))
    return min((_region_gap_m(a, b) for a, b in pairs), default=np.inf)


def _region_gap_m(first: Region, second: Region) -> float:
    gap = np.maximum(0, np.maximum(first.low - second.high, second.low - first.high))
    return float(np.linalg.norm(gap))
