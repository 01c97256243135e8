"""Changes of objects as the node shows them: published in the map, or only detected yet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gslts.change.changes import Change
from gslts.store.causes import Box, ChangeKind
from gslts.store.records import UNKNOWN, Track
from gslts.types import Floats

MAX_CHANGES = 50
"""Maximum number of objects that are shown: the last that changed. Bounds messages, and what a
person can read in a view of a home."""


@dataclass(frozen=True, eq=False)
class ShownChange:
    """The last change of an object.

    Attributes:
        name: Of the object; unique among published changes.
        kind: Type of the change.
        boxes: Boxes before and after the change, each [2,3] low and high corner in the world, m;
            None where there is no object, or where its box is unknown.
        version: Version of the map that shows it; None if no version does.
        confidence: Probability that it is real, 0 to 1; None if it is published.
    """

    name: str
    kind: ChangeKind
    boxes: tuple[Floats | None, Floats | None]
    version: int | None = None
    confidence: float | None = None

    @property
    def present(self) -> Floats | None:
        """[2,3] box where the object is now, m; None if it is gone or the box is unknown."""
        return self.boxes[1]


def published_changes(tracks: Sequence[Track]) -> list[ShownChange]:
    """Return the last change of each object that changed, at most `MAX_CHANGES`, oldest first.

    Args:
        tracks: Of the history of the map, as of `gslts.store.history.History.tracks`.
    """
    last = sorted(
        ((track.events[-1], track.name) for track in tracks if track.events),
        key=lambda pair: pair[0].version,
    )
    return [
        ShownChange(name, event.kind, _arrays(event.boxes), version=event.version)
        for event, name in last[-MAX_CHANGES:]
    ]


def detected_changes(changes: Sequence[Change]) -> list[ShownChange]:
    """Return changes that no version of the map shows yet, at most `MAX_CHANGES`.

    Args:
        changes: As the detector or its monitor reports them.
    """
    return [
        ShownChange(
            f"{UNKNOWN} {number}",
            change.kind,
            (_array(change.boxes[0]), _array(change.boxes[1])),
            confidence=change.confidence,
        )
        for number, change in enumerate(changes[:MAX_CHANGES], 1)
    ]


def _arrays(boxes: tuple[Box | None, Box | None]) -> tuple[Floats | None, Floats | None]:
    return _array(boxes[0]), _array(boxes[1])


def _array(box: tuple[object, object] | None) -> Floats | None:
    return None if box is None else np.array(box, np.float64)
