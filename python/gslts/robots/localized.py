"""A robot that localizes itself in a map by its images."""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np

from gslts.core.frame import RgbdFrame
from gslts.core.robot import Robot
from gslts.datasets.dataset import rigid
from gslts.localization.localizer import Localizer
from gslts.types import Floats


class LocalizedRobot:
    """A `Robot` in the coordinates of a map, whatever the drift of the odometry of another robot.

    Until the first frame is localized, the odometry is used as it is.

    Args:
        robot: Its poses and positions are those of its odometry, with z up.
        localizer: Localizer in the map.
    """

    def __init__(self, robot: Robot, localizer: Localizer) -> None:
        self._robot, self._localizer = robot, localizer
        self._localized: WeakKeyDictionary[RgbdFrame, RgbdFrame] = WeakKeyDictionary()

    def observe(self) -> RgbdFrame:
        """Take a frame and localize it; see `Localizer.localize_frame`.

        Each frame of a recording is localized once, so that its replay is the same object again.
        """
        frame = self._robot.observe()
        if frame not in self._localized:
            self._localized[frame] = self._localizer.localize_frame(frame)
        return self._localized[frame]

    def pose(self) -> Floats:
        """Return [4,4] world_from_camera: the odometry, corrected by the last localization."""
        world_from_odometry = self._localizer.world_from_odometry
        pose = self._robot.pose()
        return pose if world_from_odometry is None else rigid(world_from_odometry @ pose)

    def reachable_positions(self) -> Floats:
        """Return [P,2] positions that the robot can reach, x and y in the map, m."""
        turn, shift, _ = self._floor_from_odometry()
        positions: Floats = self._robot.reachable_positions() @ turn.T + shift
        return positions

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
        turn, shift, turn_rad = self._floor_from_odometry()
        return self._robot.move_towards((position - shift) @ turn, yaw_rad - turn_rad, pitch_rad)

    def _floor_from_odometry(self) -> tuple[Floats, Floats, float]:
        """Return the planar motion from odometry to map: [2,2] rotation, (2,) shift, angle, rad."""
        if self._localizer.world_from_odometry is None:
            self.observe()
        motion, position = self._localizer.world_from_odometry, self._localizer.found_at
        if motion is None or position is None:
            return np.eye(2), np.zeros(2), 0.0
        turn_rad = float(np.arctan2(motion[1, 0] - motion[0, 1], motion[0, 0] + motion[1, 1]))
        turn = np.array(
            [[np.cos(turn_rad), -np.sin(turn_rad)], [np.sin(turn_rad), np.cos(turn_rad)]]
        )
        # The motion also tilts a little. Far from the odometry's origin this is metres, so that the
        # planar motion is made exact at the position of the last localization.
        here = (motion[:3, :3] @ position + motion[:3, 3])[:2]
        return turn, here - turn @ position[:2], turn_rad


def localized(robot: Robot, localizer: Localizer | None) -> Robot:
    """Return a robot in the coordinates of a map.

    Args:
        robot: In the coordinates of its odometry.
        localizer: In the map; None if these are those of the map.
    """
    return robot if localizer is None else LocalizedRobot(robot, localizer)
