"""Detection by a robot that turns for a moment and confirms changes over several frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from gslts.change.changes import Change
from gslts.change.detector import ChangeDetector
from gslts.change.monitor import confirm_changes
from gslts.core.frame import RgbdFrame
from gslts_sim.robot_body import Viewpoint

WATCH = "watching"
"""Name of this detector, beside those of `VARIANTS`."""
WATCHED = "objects"
"""The detector of `VARIANTS` that sees each frame."""
TURNS_DEG = (-10.0, -6.0, -2.0, 2.0, 6.0, 10.0)
"""Directions of the frames, from that of a single frame, in steps of 4°."""


def turn_views(viewpoint: Viewpoint) -> list[Viewpoint]:
    """Return the viewpoints of a robot that turns on the spot past a viewpoint.

    Args:
        viewpoint: Viewpoint of a single frame.
    """
    return [
        replace(viewpoint, yaw_deg=(viewpoint.yaw_deg + turn_deg) % 360) for turn_deg in TURNS_DEG
    ]


def watch(detector: ChangeDetector, frames: Sequence[RgbdFrame]) -> tuple[str | None, list[Change]]:
    """Detect changes in several frames and confirm them with `ChangeMonitor`.

    Args:
        detector: Sees each frame.
        frames: In order of time.

    Returns:
        The reason if no frame is reliable, and the confirmed changes, most confident first.

    Raises:
        RuntimeError: A frame could not be processed.
    """
    changes, counts = confirm_changes(detector, frames)
    if counts.unreliable == counts.processed:
        return "each frame is unreliable", []
    return None, changes
