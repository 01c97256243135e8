"""Precision and recall of the object events that the history of a map tells."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gslts.store.records import UNKNOWN, ObjectEvent
from gslts_sim.task import Box, Change

FOUND_M = 0.15
"""Maximum distance of a known box's centre from the true box of a change that was found."""


@dataclass(frozen=True)
class EventScore:
    """Numbers of events.

    Attributes:
        right: Reported events that happened, each true event counted once.
        reported: Reported events.
        true: Events that happened.
    """

    right: int
    reported: int
    true: int

    @property
    def precision(self) -> float:
        """Share of the reported events that happened; 1 without reported events."""
        return self.right / self.reported if self.reported else 1.0

    @property
    def recall(self) -> float:
        """Share of the true events that are reported; 1 if nothing happened."""
        return self.right / self.true if self.true else 1.0


def true_events(changes: Sequence[Change]) -> list[Change]:
    """Put the changes of each object together as a history should tell them.

    Args:
        changes: True changes, oldest first.

    Returns:
        An object that went and came again at another position has moved; all else as it was.
    """
    events: list[Change] = []
    for change in changes:
        own = [event for event in events if event.object_id == change.object_id]
        last = own[-1] if own else None
        if change.kind == "addition" and last is not None and last.kind == "removal":
            assert last.box_before is not None
            assert change.box_after is not None
            if not is_in(np.mean(change.box_after, axis=0), last.box_before):
                events.remove(last)
                update = {"kind": "relocation", "box_before": last.box_before}
                change = change.model_copy(update=update)
        events.append(change)
    return events


def score_events(reported: Sequence[ObjectEvent], true: Sequence[Change]) -> EventScore:
    """Compare reported events with true ones: same kind and type, and each end at its position.

    Args:
        reported: Of a history.
        true: From `true_events`.
    """
    left = list(true)
    for event in reported:
        fitting = [change for change in left if fits_change(event, change)]
        if fitting:
            left.remove(fitting[0])
    return EventScore(len(true) - len(left), len(reported), len(true))


def fits_change(event: ObjectEvent, change: Change) -> bool:
    """Return whether a reported event is a true change; an event may have no type.

    Args:
        event: Of a history.
        change: The true change.
    """
    named = event.type in (UNKNOWN, change.object_type)
    return named and event.kind == change.kind and _has_ends(event, change)


def was_found(change: Change, events: Sequence[ObjectEvent]) -> bool:
    """Return whether events show a change, each of its ends at the right position.

    Args:
        change: The true change.
        events: Of a history; each end may be in another one. Shifts show shifts only.
    """
    events = [event for event in events if (event.kind == "shift") == (change.kind == "shift")]
    for side, box in enumerate((change.box_before, change.box_after)):
        boxes = [event.boxes[side] for event in events]
        known = [np.mean(known, axis=0) for known in boxes if known is not None]
        if box is not None and not any(is_in(middle, box) for middle in known):
            return False
    return True


def is_untrue(event: ObjectEvent, changes: Sequence[Change]) -> bool:
    """Return whether an event shows something at a position where nothing like it happened.

    A move of which only one end was found is not untrue, nor is a wrong type. A shift is untrue
    unless an object moved there, both before and after.

    Args:
        event: Of a history.
        changes: True changes.
    """
    if event.kind == "shift":
        moves = [change for change in changes if change.kind in ("relocation", "shift")]
        return not any(_has_ends(event, change) for change in moves)
    for side, known in enumerate(event.boxes):
        if known is None:
            continue
        true = [(change.box_before, change.box_after)[side] for change in changes]
        if not any(box is not None and is_in(np.mean(known, axis=0), box) for box in true):
            return True
    return False


def _has_ends(event: ObjectEvent, change: Change) -> bool:
    """Return whether each end of a true change is known to an event at its position."""
    pairs = zip(event.boxes, (change.box_before, change.box_after), strict=True)
    return all(
        true is None or (known is not None and is_in(np.mean(known, axis=0), true))
        for known, true in pairs
    )


def is_in(point: np.ndarray, box: Box) -> bool:
    """Return whether a position is in a box, or near it.

    Args:
        point: (3,) position, world, m.
        box: The box; `FOUND_M` beside it is still near.
    """
    low, high = np.array(box)
    return bool(np.all((point >= low - FOUND_M) & (point <= high + FOUND_M)))
