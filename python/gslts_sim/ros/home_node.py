"""ROS 2 node `home`: lets the changes of the home happen."""

from __future__ import annotations

from typing import Any

import rclpy
from std_srvs.srv import Trigger

from gslts_sim.changes import ChangeError
from gslts_sim.ros.robot import SimulatedRobot


class HomeNode:
    """Service and timer of the changes.

    Args:
        robot: The robot in the home.
        interval_s: Time between changes that happen by themselves, s; None for none.
    """

    def __init__(self, robot: SimulatedRobot, interval_s: float | None) -> None:
        self._robot = robot
        self.node = rclpy.create_node("home")
        self.node.create_service(Trigger, "/robot/change", self._on_request)
        if interval_s is not None:
            self._timer = self.node.create_timer(interval_s, self._on_time)

    def _on_request(self, _: Any, response: Any) -> Any:
        response.success, response.message = self._change()
        return response

    def _on_time(self) -> None:
        if self._robot.changes_left:
            self._change()
        else:
            self._timer.cancel()

    def _change(self) -> tuple[bool, str]:
        """Return True and a description of the change, or False and the reason for none."""
        try:
            done = True, self._robot.change()
        except ChangeError as reason:
            done = False, str(reason)
        self.node.get_logger().info(f"change: {done[1]}")
        return done
