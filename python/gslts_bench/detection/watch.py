"""What a robot reports that looks around for a moment: changes that it saw in enough frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from gslts.change.changes import Change
from gslts.change.detector import ChangeDetector
from gslts.change.monitor import confirmed
from gslts.core.frame import RgbdFrame
from gslts_sim.robot_body import Viewpoint

WATCH = "watching"
"""Name of the detector, among those of `VARIANTS`."""
WATCHED = "objects"
"""The one of these that sees each frame."""
TURNS_DEG = (-10.0, -6.0, -2.0, 2.0, 6.0, 10.0)
"""Where the robot looks one after the other, from the direction of a single frame."""


def looks_around(look: Viewpoint) -> list[Viewpoint]:
    """As a robot turns on the spot past a look."""
    return [replace(look, yaw_deg=(look.yaw_deg + turn_deg) % 360) for turn_deg in TURNS_DEG]


def watched(
    detector: ChangeDetector, frames: Sequence[RgbdFrame]
) -> tuple[str | None, list[Change]]:
    """Why nothing can be said, if so; and what `ChangeMonitor` reports, the most certain first.

    Raises:
        RuntimeError: A frame could not be looked at.
    """
    changes, counts = confirmed(detector, frames)
    if counts.unreliable == counts.looked_at:
        return "each frame is unreliable", []
    return None, changes
