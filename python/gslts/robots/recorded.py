"""A robot that replays the frames of a recorded data set."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gslts.core.frame import RgbdFrame
from gslts.types import Floats

METRES_PER_RAD = 0.5
"""Weight of a direction error against a position error in the search for the nearest frame, m/rad:
at 2 m from an object, a smaller weight would prefer frames that do not show it."""
TIE_M = 1e-9
"""Difference of such errors between frames at the same pose, m: that of rounding."""


class RecordedRobot:
    """A `Robot` that can be wherever a frame was taken; replays a recording through the protocol.

    Args:
        frames: At least one; z points up in the world of their cameras.

    Raises:
        ValueError: There is no frame.
    """

    def __init__(self, frames: Sequence[RgbdFrame]) -> None:
        if not frames:
            raise ValueError("RecordedRobot: frames: expected at least one frame, got none")
        self._frames = frames
        self._positions = np.array([f.camera.world_from_camera[:2, 3] for f in frames])
        self._ahead = np.array([frame.camera.world_from_camera[:3, 2] for frame in frames])
        self._visits = np.zeros(len(frames), np.intp)
        self._current = 0

    def observe(self) -> RgbdFrame:
        """Return the current frame, always the same object."""
        return self._frames[self._current]

    def pose(self) -> Floats:
        """Return [4,4] world_from_camera of the current frame, m."""
        return self._frames[self._current].camera.world_from_camera

    def reachable_positions(self) -> Floats:
        """Return [P,2] distinct positions of the frames, x and y in the world, m."""
        return np.unique(self._positions, axis=0)

    def move_towards(
        self, position: Floats, yaw_rad: float, pitch_rad: float | None = None
    ) -> bool:
        """Make the frame with the nearest position and direction the current one.

        Frames of a camera that stood still come in turn, each as often as the others.

        Args:
            position: (2,) x and y in the world, m.
            yaw_rad: Direction, rad.
            pitch_rad: Angle below the horizon, rad; None means that it does not count.

        Returns:
            True always: some frame is the nearest.
        """
        metres = np.linalg.norm(self._positions - position, axis=1)
        x, y, z = self._ahead.T
        turns_rad = np.abs((np.arctan2(y, x) - yaw_rad + np.pi) % (2 * np.pi) - np.pi)
        if pitch_rad is not None:
            tilts_rad = np.arctan2(-z, np.hypot(x, y)) - pitch_rad
            turns_rad = np.hypot(turns_rad, tilts_rad)
        errors_m = metres + METRES_PER_RAD * turns_rad
        nearest = np.flatnonzero(errors_m <= errors_m.min() + TIE_M)
        self._current = int(nearest[np.argmin(self._visits[nearest])])
        self._visits[self._current] += 1
        return True
