"""A robot in another world frame than its own."""

from __future__ import annotations

import numpy as np

from gslts.core.frame import RgbdFrame
from gslts.core.robot import Robot
from gslts.core.se3 import inverse_transform, transform
from gslts.datasets.dataset import rigid
from gslts.localization.localizer import in_world
from gslts.types import Floats


class RobotInFrame:
    """A `Robot` in the frame of a map, of a robot whose frame is another one.

    Args:
        robot: In its own frame, z up.
        map_from_robot: [4,4] rigid, upright, m.
    """

    def __init__(self, robot: Robot, map_from_robot: Floats) -> None:
        self._robot, self._map_from_robot = robot, map_from_robot

    def observe(self) -> RgbdFrame:
        """Take a frame, at its pose in the map."""
        return in_world(self._robot.observe(), self._map_from_robot)

    def pose(self) -> Floats:
        """Return [4,4] world_from_camera in the map, m."""
        return rigid(self._map_from_robot @ self._robot.pose())

    def reachable_positions(self) -> Floats:
        """Return [P,2] positions that the robot can reach, x and y in the map, m."""
        positions = self._robot.reachable_positions()
        heights = np.full((len(positions), 1), self._robot.pose()[2, 3])
        return transform(self._map_from_robot, np.hstack([positions, heights]))[:, :2]

    def move_towards(
        self, position: Floats, yaw_rad: float, pitch_rad: float | None = None
    ) -> bool:
        """Move the robot in the coordinates of the map; see `Robot.move_towards`.

        Args:
            position: (2,) x and y in the map, m.
            yaw_rad: Final direction in the map, rad.
            pitch_rad: Final angle below the horizon, rad; None keeps the current one.

        Returns:
            True if the robot arrived.
        """
        turn = self._map_from_robot[:3, :3]
        turn_rad = float(np.arctan2(turn[1, 0] - turn[0, 1], turn[0, 0] + turn[1, 1]))
        at_camera = np.array([*position, self.pose()[2, 3]])
        target = inverse_transform(self._map_from_robot, at_camera)[:2]
        return self._robot.move_towards(target, yaw_rad - turn_rad, pitch_rad)
