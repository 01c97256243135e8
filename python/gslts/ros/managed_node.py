"""The node of ROS, which a lifecycle manager can end."""

from __future__ import annotations

import threading
from typing import Any

import rclpy
from rclpy.node import Node


def make_node(name: str, stop: threading.Event) -> Node:
    """Create a node that is active from its start, and that a lifecycle shutdown ends.

    It cannot be deactivated. Where lifecycle_msgs cannot be imported, it is a plain node.

    Args:
        name: Of the node.
        stop: Set by the shutdown, so that the node ends at the next safe point.
    """
    try:
        from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn
    except ImportError:
        return rclpy.create_node(name)

    class ManagedNode(LifecycleNode):  # type: ignore[misc]  # rclpy has no types.
        def on_deactivate(self, _: Any) -> TransitionCallbackReturn:
            self.get_logger().warning("it cannot be deactivated; a shutdown ends it")
            return TransitionCallbackReturn.FAILURE

        def on_shutdown(self, _: Any) -> TransitionCallbackReturn:
            stop.set()
            return TransitionCallbackReturn.SUCCESS

    node = ManagedNode(name)
    node.trigger_configure()
    node.trigger_activate()
    return node
