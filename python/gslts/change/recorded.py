"""Surfaces that the recording of a map measured already: what the map does not show is not new."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from gslts._core import detect as _core
from gslts.change.changes import Box
from gslts.change.constants import LEFT_MARGIN_M, MIN_RECORDING_FRAMES
from gslts.store.recorded_depths import RecordedDepths
from gslts.types import Bools, Floats


def find_recorded(
    surfaces: Iterable[_core.Surface], depths: RecordedDepths, left: Sequence[Box]
) -> None:
    """Set what the recording tells of surfaces that only a frame shows, in their visibility.

    A surface as thin as a sheet of paper is on the one behind it, and is left out.

    Args:
        surfaces: With their visibility, without those that moved a little.
        depths: Of the recording.
        left: Boxes in which objects were that left since: low and high corners, world, m.
    """
    for surface in surfaces:
        seen = surface.visibility
        if seen is None or surface.side != _core.Side.AFTER or surface.flat:
            continue
        points = np.array(surface.samples)
        counts = depths.counts(points)
        is_recorded = counts.on >= MIN_RECORDING_FRAMES
        is_free = counts.behind >= MIN_RECORDING_FRAMES
        for low, high in left:
            inside = _is_in(points, low, high)
            is_recorded &= ~inside
            is_free |= inside
        # Where hardly a depth was measured, rendered ones must do.
        is_known = is_free | (counts.before + counts.on + counts.behind >= MIN_RECORDING_FRAMES)
        surface.visibility = _core.Visibility(
            on_surface=seen.on_surface,
            seen_through=seen.seen_through,
            known_share=seen.known_share,
            recorded_share=float(is_recorded.mean()),
            free_share=float(is_free.mean() + (~is_known).mean()),
        )


def _is_in(points: Floats, low: Floats, high: Floats) -> Bools:
    inside = (points >= low - LEFT_MARGIN_M) & (points <= high + LEFT_MARGIN_M)
    return np.asarray(np.all(inside, axis=1), np.bool_)
