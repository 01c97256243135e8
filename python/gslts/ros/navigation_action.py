"""Goals by Nav2's action NavigateToPose, whose server also tells when it has ended with a goal."""

from __future__ import annotations

import uuid
from collections import deque
from collections.abc import Callable
from typing import Any

from action_msgs.msg import GoalStatus, GoalStatusArray
from geometry_msgs.msg import PoseStamped
from nav2_msgs.action import NavigateToPose
from rclpy.action import ActionClient
from rclpy.node import Node
from rclpy.qos import qos_profile_action_status_default
from unique_identifier_msgs.msg import UUID

NAME = "navigate_to_pose"
"""Name of the action."""
OWN_GOALS = 8
"""Number of last goals of the node by which it knows its own in the status of the server."""
ACTIVE = (GoalStatus.STATUS_ACCEPTED, GoalStatus.STATUS_EXECUTING)
"""Statuses of goals that the robot follows."""


class NavigationAction:
    """Client of the action. Its callbacks run in the thread that spins the node.

    Args:
        node: Of ROS.
        on_foreign: Called if the robot follows a goal of somebody else.

    Attributes:
        has_ended: True if the server has ended with the last goal, reached or not.
    """

    def __init__(self, node: Node, on_foreign: Callable[[], None]) -> None:
        self._client, self._on_foreign = ActionClient(node, NavigateToPose, NAME), on_foreign
        self._own = deque[bytes](maxlen=OWN_GOALS)
        self._handle: Any = None
        self._is_busy = self._is_cancelled = self.has_ended = False
        node.create_subscription(
            GoalStatusArray,
            f"{NAME}/_action/status",
            self._on_status,
            qos_profile_action_status_default,
        )

    @property
    def is_ready(self) -> bool:
        """True if there is a server."""
        return bool(self._client.server_is_ready())

    @property
    def is_busy(self) -> bool:
        """True while the robot follows a goal of somebody else."""
        if not self.is_ready:  # A server that starts anew does not say that it has no goal.
            self._is_busy = False
        return self._is_busy

    def drive_to(self, goal: PoseStamped) -> None:
        """Give a goal, which replaces the last one.

        Args:
            goal: Pose of the base.
        """
        own = uuid.uuid4().bytes
        self._own.append(own)
        self._handle, self._is_cancelled, self.has_ended = None, False, False
        future = self._client.send_goal_async(
            NavigateToPose.Goal(pose=goal), goal_uuid=UUID(uuid=list(own))
        )
        future.add_done_callback(lambda answered: self._on_answer(own, answered.result()))

    def cancel(self) -> None:
        """Cancel the last goal, if the robot follows it or is about to."""
        self._is_cancelled = True
        if self._handle is not None:
            self._handle.cancel_goal_async()

    def _on_answer(self, own: bytes, handle: Any) -> None:
        if own != self._own[-1]:
            return
        if not handle.accepted:
            self.has_ended = True
            return
        self._handle = handle
        handle.get_result_async().add_done_callback(lambda _: self._on_result(own))
        if self._is_cancelled:
            handle.cancel_goal_async()

    def _on_result(self, own: bytes) -> None:
        if own == self._own[-1]:
            self._handle, self.has_ended = None, True

    def _on_status(self, message: GoalStatusArray) -> None:
        active = [
            bytes(status.goal_info.goal_id.uuid)
            for status in message.status_list
            if status.status in ACTIVE
        ]
        self._is_busy = any(goal not in self._own for goal in active)
        if self._is_busy:
            self._on_foreign()
