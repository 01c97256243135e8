"""Protocol of a robot, simulated or real."""

from __future__ import annotations

from typing import Protocol

from gslts.core.frame import RgbdFrame
from gslts.types import Floats


class RobotLostError(Exception):
    """The robot has no pose or no frame at present."""


class Robot(Protocol):
    """A wheeled robot with an RGB-D camera, as seen by the map keeper and the navigator.

    Methods of a real one may raise RobotLostError.
    """

    def observe(self) -> RgbdFrame:
        """Take a frame, with the camera pose that the robot believes."""
        ...

    def pose(self) -> Floats:
        """Return the pose that the robot believes, without taking a frame.

        Returns:
            [4,4] world_from_camera, rigid, m.
        """
        ...

    def reachable_positions(self) -> Floats:
        """Return [P,2] positions that the robot can reach, x and y in the world, m."""
        ...

    def move_towards(
        self, position: Floats, yaw_rad: float, pitch_rad: float | None = None
    ) -> bool:
        """Move to the reachable position nearest to `position`, then turn.

        Args:
            position: (2,) x and y in the world, m.
            yaw_rad: Final direction of the camera about the z axis, from x to y, rad.
            pitch_rad: Final angle of the camera below the horizon, rad, clipped to what the camera
                can tilt; None keeps the current one.

        Returns:
            True if the robot arrived.
        """
        ...
