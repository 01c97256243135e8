"""A recorded data set as a robot, which can be wherever a frame was taken."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gslts.core.frame import RgbdFrame

METRES_PER_RAD = 0.5
"""What a wrong direction counts against a wrong place when the nearest frame is looked for."""


class RecordedRobot:
    """Replays frames; satisfies `gslts.core.robot.Robot`.

    Args:
        frames: At least one; their cameras' world has z up.

    Raises:
        ValueError: There is no frame.
    """

    def __init__(self, frames: Sequence[RgbdFrame]) -> None:
        if not frames:
            raise ValueError("RecordedRobot: frames: there is none")
        self._frames = frames
        self._positions = np.array([f.camera.world_from_camera[:2, 3] for f in frames])
        self._ahead = np.array([frame.camera.world_from_camera[:3, 2] for frame in frames])
        self._at = 0

    def observe(self) -> RgbdFrame:
        """The frame that it is at."""
        return self._frames[self._at]

    def reachable_positions(self) -> NDArray[np.float64]:
        """[P,2] places from which there are frames, x and y in the world, m."""
        return np.unique(self._positions, axis=0)

    def move_towards(
        self, position: NDArray[np.float64], yaw_rad: float, pitch_rad: float | None = None
    ) -> bool:
        """Goes to the frame whose place and direction are nearest; one is always found."""
        metres = np.linalg.norm(self._positions - position, axis=1)
        x, y, z = self._ahead.T
        turns_rad = np.abs((np.arctan2(y, x) - yaw_rad + np.pi) % (2 * np.pi) - np.pi)
        if pitch_rad is not None:
            tilts_rad = np.arctan2(-z, np.hypot(x, y)) - pitch_rad
            turns_rad = np.hypot(turns_rad, tilts_rad)
        self._at = int(np.argmin(metres + METRES_PER_RAD * turns_rad))
        return True
