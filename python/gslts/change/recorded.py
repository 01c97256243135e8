"""Surfaces that the recording of a map contradicts: it measured the new, or never what is gone."""

from __future__ import annotations

from collections.abc import Container, Iterable

import numpy as np

from gslts._core import detect as _core
from gslts.change.constants import MIN_RECORDED_RATE, MIN_RECORDING_FRAMES, MOVED_MARGIN_M
from gslts.store.recorded_depths import RecordedDepths
from gslts.types import Bools, Floats


def find_recorded(
    surfaces: Iterable[_core.Surface],
    depths: RecordedDepths,
    left: Floats,
    came: Floats,
    added: Container[int],
) -> None:
    """Set what the recording tells of surfaces that only the map or only a frame shows.

    A surface as thin as a sheet of paper is on the one behind it, and is left out.

    Args:
        surfaces: With their visibility, which is set, without those that moved a little.
        depths: Of the recording.
        left: [B,2,3] boxes in which objects were that left since: low and high corners, world, m.
        came: [B,2,3] boxes to which objects came since.
        added: Labels of surfaces of the map that came since.
    """
    for surface in surfaces:
        seen = surface.visibility
        if seen is None or surface.flat or surface.label in added:
            continue
        points = np.array(surface.samples)
        counts = depths.counts(points)
        is_measured = counts.on >= MIN_RECORDING_FRAMES
        is_free = counts.behind >= MIN_RECORDING_FRAMES
        recorded_share, free_share, missing_share = 0.0, 1.0, 0.0
        if surface.side == _core.Side.BEFORE:
            missing_share = (is_free & ~is_measured & ~_are_in(points, came)).mean()
        else:
            has_left = _are_in(points, left)
            is_often = counts.on >= MIN_RECORDED_RATE * (counts.on + counts.behind)
            recorded_share = (is_measured & is_often & ~has_left).mean()
            # Where hardly a depth was measured, rendered ones must do.
            is_unknown = counts.before + counts.on + counts.behind < MIN_RECORDING_FRAMES
            free_share = (is_free | has_left | is_unknown).mean()
        surface.visibility = _core.Visibility(
            on_surface=seen.on_surface,
            seen_through=seen.seen_through,
            known_share=seen.known_share,
            recorded_share=recorded_share,
            free_share=free_share,
            missing_share=missing_share,
        )


def _are_in(points: Floats, boxes: Floats) -> Bools:
    """Return [P] which points [P,3] are in a box [B,2,3]; few of many boxes are near them."""
    low, high = boxes[:, 0] - MOVED_MARGIN_M, boxes[:, 1] + MOVED_MARGIN_M
    near = np.all((low <= points.max(axis=0)) & (high >= points.min(axis=0)), axis=1)
    inside = (points[:, None] >= low[near]) & (points[:, None] <= high[near])
    return np.asarray(np.any(np.all(inside, axis=2), axis=1), np.bool_)
