"""Goals for the navigation of a robot, and angles for its camera."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from geometry_msgs.msg import PoseStamped
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray, Header

from gslts.ros.pose_message import pose_message
from gslts.ros.robot import yaw_pose
from gslts.types import Floats

try:
    from gslts.ros.navigation_action import NavigationAction
except ImportError:  # This ROS lacks nav2_msgs.
    NavigationAction = None  # type: ignore[assignment, misc]

QUEUE = 10
"""Depth of the queues."""
OWN_GOALS = 8
"""Number of last goals of the node by which it knows its own messages when it receives them."""


class Goals:
    """Gives goals to Nav2: by its action where it runs and `nav2_msgs` can be imported.

    Otherwise they are published on `goal_pose`, which Nav2 and other navigation follow.

    Args:
        node: Of ROS.
        tilt: Topic of the angle of the camera; "" if it is fixed.
        frame: Returns the name of the frame of the poses.
        on_foreign: Called if somebody else gives the robot a goal.
    """

    def __init__(
        self, node: Node, tilt: str, frame: Callable[[], str], on_foreign: Callable[[], None]
    ) -> None:
        self._node, self._frame, self._on_foreign = node, frame, on_foreign
        self._own = deque[tuple[float, float]](maxlen=OWN_GOALS)
        self._goals = node.create_publisher(PoseStamped, "goal_pose", QUEUE)
        self._tilt = node.create_publisher(Float64MultiArray, tilt, QUEUE) if tilt else None
        node.create_subscription(PoseStamped, "goal_pose", self._on_goal, QUEUE)
        self._action = None if NavigationAction is None else NavigationAction(node, on_foreign)

    @property
    def is_busy(self) -> bool:
        """True while the robot is known to follow a goal of somebody else."""
        return self._action is not None and self._action.is_busy

    @property
    def has_ended(self) -> bool:
        """True if the navigation said that it has ended with the last goal, reached or not."""
        return self._action is not None and self._action.has_ended

    def cancel(self) -> None:
        """Cancel the last goal, where the navigation can."""
        if self._action is not None:
            self._action.cancel()

    def drive_to(self, position: Floats, yaw_rad: float) -> None:
        """Give a goal.

        Args:
            position: (2,) x and y in the frame of the poses, m.
            yaw_rad: Direction of the camera, rad.
        """
        header = Header(frame_id=self._frame(), stamp=self._node.get_clock().now().to_msg())
        message = PoseStamped(header=header, pose=pose_message(yaw_pose(position, yaw_rad)))
        if self._action is not None and self._action.is_ready:
            self._action.drive_to(message)
            return
        self._own.append((message.pose.position.x, message.pose.position.y))
        self._goals.publish(message)

    def tilt_to(self, pitch_rad: float) -> None:
        """Tilt the camera if it can be tilted.

        Args:
            pitch_rad: Angle below the horizon, rad.
        """
        if self._tilt is not None:
            self._tilt.publish(Float64MultiArray(data=[pitch_rad]))

    def _on_goal(self, message: PoseStamped) -> None:
        if (message.pose.position.x, message.pose.position.y) not in self._own:
            self._on_foreign()
