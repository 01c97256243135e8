"""A robot whose frames somebody else sees as well."""

from __future__ import annotations

from collections.abc import Callable

from gslts.core.frame import RgbdFrame
from gslts.core.robot import Robot


class WatchedRobot:
    """A `Robot` that shows each frame which it takes.

    Args:
        robot: Does the work.
        show: Called with each frame.
    """

    def __init__(self, robot: Robot, show: Callable[[RgbdFrame], None]) -> None:
        self._robot, self._show = robot, show
        self.pose = robot.pose
        self.reachable_positions = robot.reachable_positions
        self.move_towards = robot.move_towards

    def observe(self) -> RgbdFrame:
        """Take a frame and show it."""
        frame = self._robot.observe()
        self._show(frame)
        return frame
