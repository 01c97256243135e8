"""Surfaces that the recording of a map measured already: what the map does not show is not new."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from gslts._core import detect as _core
from gslts.change.constants import LEFT_MARGIN_M, MIN_RECORDING_FRAMES
from gslts.store.recorded_depths import RecordedDepths
from gslts.types import Bools, Floats


def find_recorded(surfaces: Iterable[_core.Surface], depths: RecordedDepths, left: Floats) -> None:
    """Set what the recording tells of surfaces that only a frame shows, in their visibility.

    A surface as thin as a sheet of paper is on the one behind it, and is left out.

    Args:
        surfaces: With their visibility, without those that moved a little.
        depths: Of the recording.
        left: [B,2,3] boxes in which objects were that left since: low and high corners, world, m.
    """
    for surface in surfaces:
        seen = surface.visibility
        if seen is None or surface.side != _core.Side.AFTER or surface.flat:
            continue
        points = np.array(surface.samples)
        counts = depths.counts(points)
        has_left = _are_in(points, left)
        is_recorded = (counts.on >= MIN_RECORDING_FRAMES) & ~has_left
        is_free = (counts.behind >= MIN_RECORDING_FRAMES) | has_left
        # Where hardly a depth was measured, rendered ones must do.
        is_known = is_free | (counts.before + counts.on + counts.behind >= MIN_RECORDING_FRAMES)
        surface.visibility = _core.Visibility(
            on_surface=seen.on_surface,
            seen_through=seen.seen_through,
            known_share=seen.known_share,
            recorded_share=float(is_recorded.mean()),
            free_share=float(is_free.mean() + (~is_known).mean()),
        )


def _are_in(points: Floats, boxes: Floats) -> Bools:
    """Return [P] which points [P,3] are in a box [B,2,3]; few of many boxes are near them."""
    low, high = boxes[:, 0] - LEFT_MARGIN_M, boxes[:, 1] + LEFT_MARGIN_M
    near = np.all((low <= points.max(axis=0)) & (high >= points.min(axis=0)), axis=1)
    inside = (points[:, None] >= low[near]) & (points[:, None] <= high[near])
    return np.asarray(np.any(np.all(inside, axis=2), axis=1), np.bool_)
