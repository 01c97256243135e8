"""Objects that moved while the robot collected views of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gslts.core.gaussian_map import GaussianMap
from gslts.types import Bools, Ints32
from gslts.update.edit import Edit
from gslts.update.selection import count_visibility
from gslts.update.views import View

MIN_VIEWS = 2
"""Minimum number of views before and after the moment at which a Gaussian moved."""
MIN_AGREEMENT = 0.9
"""Minimum share of the views that agree with that moment; errors of depth come and go instead."""


def unsteady_share(before: GaussianMap, edit: Edit, views: Sequence[View]) -> float:
    """Compute the share of edited Gaussians that moved during the collection.

    Args:
        before: Map before the edit.
        edit: Removed and added Gaussians.
        views: Training views in the order in which they were taken.

    Returns:
        Share of the Gaussians that views show up to some view and no longer after it, or the other
        way round; 0 if nothing was edited.
    """
    rows = np.arange(edit.gaussian_map.size)
    added = edit.gaussian_map.select(rows >= rows.size - edit.added)
    unsteady = total = 0
    for part in (before.select(edit.removed), added):
        counts = [count_visibility(part, [view]) for view in views]
        on, through = (np.array(side) for side in zip(*counts, strict=True))
        unsteady += int((changes_once(on, through) | changes_once(through, on)).sum())
        total += part.size
    return unsteady / total if total else 0.0


def changes_once(first: Ints32, second: Ints32) -> Bools:
    """Return the Gaussians of which views say one thing up to a moment, and another thing after it.

    Args:
        first: [V,N] views that say the first thing, 0 or 1, in their order.
        second: [V,N] views that say the second thing.

    Returns:
        [N] bool.
    """
    votes = first.sum(axis=0) + second.sum(axis=0)
    before = first.cumsum(axis=0)
    after = second.sum(axis=0) - second.cumsum(axis=0)
    enough = (before >= MIN_VIEWS) & (after >= MIN_VIEWS)
    changed: Bools = (enough & (before + after >= MIN_AGREEMENT * votes)).any(axis=0)
    return changed
