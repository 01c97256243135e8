"""Type of a changed object, such as "Mug": from labels of frames, the history, or semantics."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from gslts.change.changes import Change
from gslts.store.match_score import is_at
from gslts.store.records import UNKNOWN, Event
from gslts.update.region import Region
from gslts.update.views import View, pixels_in_region

MARGIN_M = 0.02
"""Margin around the box of an added object in which its pixels lie, m."""
MIN_LABEL_SHARE = 0.5
"""Minimum share of the labelled pixels that agree on a type."""
MAX_DISTANCE_M = 0.15
"""Maximum distance from a removed object to the position where the history has it, m."""


def object_type(
    change: Change,
    views: Iterable[View],
    events: Sequence[Event],
    name_region: Callable[[Region], str | None] = lambda _: None,
    name_added: Callable[[Region], str | None] = lambda _: None,
) -> str:
    """Return the type of a changed object.

    Args:
        change: Of the object.
        views: After the change; their frames may have labels.
        events: History of the map, oldest first.
        name_region: Returns what the removed or shifted Gaussians of a region are.
        name_added: Returns what the new Gaussians of a region are.

    Returns:
        A type such as "Mug"; "object" if nothing names it.
    """
    before, after = change.boxes
    name = None if after is None else _labelled_type(Region("after", *after), views)
    if name is None and before is not None:
        region = Region("before", *before)
        # An object of the history in the box of furniture may stand on it.
        history = None if change.kind == "shift" else _type_in_history(region, events)
        name = history or name_region(region)
    if name is None and after is not None:
        name = name_added(Region("after", *after))
    return name or UNKNOWN


def _labelled_type(region: Region, views: Iterable[View]) -> str | None:
    """Return the type of most labelled pixels of an added object."""
    votes: Counter[str] = Counter()
    for view in views:
        labels = view.frame.labels
        if labels is not None:
            added = view.after & pixels_in_region(view.depth, view.camera, region, MARGIN_M)
            instances, counts = np.unique(labels.instances[added], return_counts=True)
            for instance, count in zip(instances.tolist(), counts.tolist(), strict=True):
                if instance >= 0:
                    votes[labels.types[instance]] += count
    if not votes:
        return None
    name, count = votes.most_common(1)[0]
    return name if count >= MIN_LABEL_SHARE * votes.total() else None


def _type_in_history(region: Region, events: Sequence[Event]) -> str | None:
    """Return the type of the last object that came to a region, and has not left it since."""
    present: list[Event] = []
    for event in events:
        before, after = event.boxes
        present = [
            other
            for other in present
            if event.type not in (other.type, UNKNOWN) or not is_at(before, other.boxes[1])
        ]
        if after is not None and event.type != UNKNOWN:
            present.append(event)
    for event in reversed(present):
        assert event.boxes[1] is not None
        if region.contains(np.mean(event.boxes[1], axis=0), MAX_DISTANCE_M):
            return event.type
    return None
