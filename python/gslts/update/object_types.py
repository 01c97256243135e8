"""What an object that changed is called, where frames or the past of a map know it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from gslts.change.changes import Change
from gslts.store.records import Event
from gslts.update.region import Region
from gslts.update.views import View, near_region

UNKNOWN = "object"
MARGIN_M = 0.02
"""So far beyond the box of what is new its pixels may lie."""
LEAST_SHARE = 0.5
"""Of the pixels that are told apart, which must agree."""
NEAR_M = 0.15
"""An object that is gone stood where it was last seen, or that near."""


def type_of(
    change: Change,
    views: Iterable[View],
    events: Sequence[Event],
    named: Callable[[Region], str | None] = lambda _: None,
) -> str:
    """The type of an object, such as "Mug"; "object" where nobody knows it.

    Args:
        change: Of the object.
        views: Around it, after the change; their frames may have labels.
        events: What became of objects before, the first one first.
        named: What the Gaussians of the map mean that vanished from a region.
    """
    before, after = change.boxes
    seen = None if after is None else _seen(Region("after", *after), views)
    if seen is None and before is not None:
        region = Region("before", *before)
        seen = _known(region, events) or named(region)
    return seen or UNKNOWN


def _seen(region: Region, views: Iterable[View]) -> str | None:
    """What most pixels of what is new show."""
    votes: Counter[str] = Counter()
    for view in views:
        labels = view.frame.labels
        if labels is not None:
            new = view.after & near_region(view.depth, view.camera, region, MARGIN_M)
            rows, counts = np.unique(labels.instances[new], return_counts=True)
            for row, count in zip(rows.tolist(), counts.tolist(), strict=True):
                if row >= 0:
                    votes[labels.types[row]] += count
    if not votes:
        return None
    name, count = votes.most_common(1)[0]
    return name if count >= LEAST_SHARE * votes.total() else None


def _known(region: Region, events: Sequence[Event]) -> str | None:
    """What came to a place last."""
    for event in reversed(events):
        if event.type != UNKNOWN and event.boxes[1] is not None:
            middle = np.mean(event.boxes[1], axis=0)
            if region.contains(middle, NEAR_M):
                return event.type
    return None
