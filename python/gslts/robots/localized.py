"""A robot that looks where in the map it is."""

from __future__ import annotations

from weakref import WeakKeyDictionary

import numpy as np

from gslts.core.frame import RgbdFrame
from gslts.core.robot import Robot
from gslts.localization.localizer import Localizer
from gslts.types import Floats


class LocalizedRobot:
    """A robot in the coordinates of a map, however far its odometry is off; itself a `Robot`.

    Until it was found for the first time, its odometry is believed.

    Args:
        robot: Whose poses and places are those of its odometry, with z up.
        localizer: Of the map.
    """

    def __init__(self, robot: Robot, localizer: Localizer) -> None:
        self._robot, self._localizer = robot, localizer
        self._seen: WeakKeyDictionary[RgbdFrame, RgbdFrame] = WeakKeyDictionary()

    def observe(self) -> RgbdFrame:
        """What the camera sees now, where the map says; see `Localizer.located`.

        A robot that replays a frame gives the very same one again.
        """
        frame = self._robot.observe()
        if frame not in self._seen:
            self._seen[frame] = self._localizer.located(frame)
        return self._seen[frame]

    def reachable_positions(self) -> Floats:
        """[P,2] places of the robot's middle on the floor, x and y in the map, m."""
        turn, shift, _ = self._on_floor()
        places: Floats = self._robot.reachable_positions() @ turn.T + shift
        return places

    def move_towards(
        self, position: Floats, yaw_rad: float, pitch_rad: float | None = None
    ) -> bool:
        """As `Robot.move_towards`, place and direction being those of the map."""
        turn, shift, turn_rad = self._on_floor()
        return self._robot.move_towards((position - shift) @ turn, yaw_rad - turn_rad, pitch_rad)

    def _on_floor(self) -> tuple[Floats, Floats, float]:
        """[2,2] and (2,), turn and shift from odometry to map, and the angle of the turn, rad."""
        if self._localizer.world_from_odometry is None:
            self.observe()
        motion, place = self._localizer.world_from_odometry, self._localizer.found_at
        if motion is None or place is None:
            return np.eye(2), np.zeros(2), 0.0
        turn_rad = float(np.arctan2(motion[1, 0] - motion[0, 1], motion[0, 0] + motion[1, 1]))
        turn = np.array(
            [[np.cos(turn_rad), -np.sin(turn_rad)], [np.sin(turn_rad), np.cos(turn_rad)]]
        )
        # The motion also tilts a little, which is metres where the odometry counts from far away:
        # what it says of the place where the robot was found is right.
        here = (motion[:3, :3] @ place + motion[:3, 3])[:2]
        return turn, here - turn @ place[:2], turn_rad
