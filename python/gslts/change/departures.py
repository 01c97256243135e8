"""Objects that came since a map was made: they are likelier to go than what was always there."""

from __future__ import annotations

from collections.abc import Container, Iterable, Sequence

import numpy as np

from gslts._core import detect as _core
from gslts.change.constants import CAME_LOG_ODDS, MIN_CAME_SHARE
from gslts.types import Bools, Floats32, Ints32, UInts64


def are_in(ids: UInts64, ranges: Sequence[range]) -> Bools:
    """Return which ids are in one of some ranges.

    Args:
        ids: [N] of Gaussians.
        ranges: Ranges with a step of 1, rising, none of which overlaps another one.

    Returns:
        [N] bool.
    """
    if not ranges:
        return np.zeros(len(ids), np.bool_)
    starts, stops = np.array([(part.start, part.stop) for part in ranges], np.uint64).T
    rows = np.searchsorted(starts, ids, side="right")
    return np.asarray((rows > 0) & (ids < stops[np.maximum(rows, 1) - 1]))


def find_added(surfaces: Iterable[_core.Surface], labels: Ints32, came: Floats32) -> set[int]:
    """Return the labels of the surfaces of the map that mostly show what updates added.

    Args:
        surfaces: Surfaces visible in only one of map and frame.
        labels: [H,W] label of the surface at each pixel, 0 for none.
        came: [H,W] weight, 0 to 1, of what updates added in each pixel of the map.
    """
    if not came.any():
        return set()
    seen = [surface.label for surface in surfaces if surface.side == _core.Side.BEFORE]
    flat, bins = labels.ravel(), 1 + max(seen, default=0)
    sums = np.bincount(flat, weights=came.ravel(), minlength=bins)
    counts = np.bincount(flat, minlength=bins)
    return {label for label in seen if sums[label] >= MIN_CAME_SHARE * counts[label] > 0}


def expect_departures(surfaces: Iterable[_core.Surface], added: Container[int]) -> None:
    """Raise the confidence of regions of the map that mostly show what updates added.

    Args:
        surfaces: Surfaces visible in only one of map and frame; those without a confidence of
            their colours stay as they are.
        added: Labels of those regions.
    """
    for surface in surfaces:
        confidence = surface.color_confidence
        if confidence is not None and surface.label in added:
            came_odds = np.exp(CAME_LOG_ODDS) * confidence
            surface.color_confidence = float(came_odds / (came_odds + (1 - confidence)))
