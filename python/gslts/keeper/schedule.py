"""Which change is looked at next, and which ones have to wait."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from gslts.change.changes import Change, Kind
from gslts.types import Floats
from gslts.update.region import Region, regions_of

TOGETHER_M = 1.0
"""Changes nearer to each other are repaired by one update: each would see the other one."""
HALF_M = 2.0
"""So far away a change counts half as much as here."""
NEAR_M = 0.3
"""Within this distance, changes of one kind are the same one."""
MOST_WAIT = 16
"""Rounds until a change is tried again, at most."""


class DeferredChange(BaseModel):
    """A change that could not be repaired.

    Attributes:
        kind: Of the change.
        point: (3,) where it is, in the world, m.
        reason: Why the map stayed as it was.
        tries: How often it was tried.
        until: From this round on it is tried again, if it is still seen.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    kind: Kind
    point: tuple[FiniteFloat, FiniteFloat, FiniteFloat]
    reason: str
    tries: Annotated[int, Field(ge=1)]
    until: Annotated[int, Field(ge=0)]

    def is_of(self, change: Change) -> bool:
        """Whether a change is this one."""
        near = float(np.linalg.norm(change.point - np.array(self.point))) <= NEAR_M
        return near and change.kind == self.kind


def next_changes(waiting: Sequence[Change], place: Floats) -> list[Change]:
    """The change whose turn it is, and those that are repaired together with it.

    Args:
        waiting: At least one.
        place: (2,) where the robot is, x and y in the world, m.
    """

    def worth(change: Change) -> float:
        return change.confidence / (1 + float(np.linalg.norm(change.point[:2] - place)) / HALF_M)

    first = max(waiting, key=worth)
    return [one for one in waiting if one is first or _apart_m(one, first) <= TOGETHER_M]


def defer(
    deferred: Sequence[DeferredChange], change: Change, reason: str, number: int
) -> tuple[DeferredChange, ...]:
    """What is deferred after a change could not be repaired in a round; longer with each try."""
    tries = 1 + max((one.tries for one in deferred if one.is_of(change)), default=0)
    x, y, z = change.point.tolist()
    until = number + min(2 ** (tries - 1), MOST_WAIT)
    new = DeferredChange(kind=change.kind, point=(x, y, z), reason=reason, tries=tries, until=until)
    return (*(one for one in deferred if not one.is_of(change)), new)


def _apart_m(one: Change, other: Change) -> float:
    """Between the nearest points of what belongs to both, m."""
    return min(
        (_gap_m(region, near) for region in regions_of(one) for near in regions_of(other)),
        default=np.inf,
    )


def _gap_m(one: Region, other: Region) -> float:
    gap = np.maximum(0, np.maximum(one.low - other.high, other.low - one.high))
    return float(np.linalg.norm(gap))
