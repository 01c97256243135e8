"""ROS 2 node `robot`: publishes what the simulated robot measures, and obeys goals."""

from __future__ import annotations

import json
import os
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from pathlib import Path
from typing import Any

import numpy as np

try:
    import rclpy
    from geometry_msgs.msg import PoseStamped
    from nav_msgs.msg import Odometry
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
    from rclpy.signals import SignalHandlerOptions
    from sensor_msgs.msg import CameraInfo, Image
    from std_msgs.msg import Float64MultiArray, String
    from std_srvs.srv import Trigger
except ImportError as error:
    raise ImportError(
        f"{error}: source ROS 2 first, such as /opt/ros/jazzy/setup.bash, or use the interpreter "
        "of `scripts/setup ros`"
    ) from error

from gslts.core.se3 import product
from gslts.ros.image_message import image_message
from gslts.ros.pose_message import pose_message, transform_message
from gslts_sim.ros import messages
from gslts_sim.ros.home_node import HomeNode
from gslts_sim.ros.robot import TICK_S, RobotState, SimulatedRobot, base_from_camera

TICK_NS = round(TICK_S * 1e9)
QUEUE = 10
"""Depth of the queues of reliable topics."""
MAX_LAG_TICKS = 25
"""Number of ticks that are made up for after a pause; after a longer one the robot stood still."""
POLL_S = 0.2
"""Maximum time to wait for a message before a stop is noticed, s."""
LOG_S = 5.0
"""Minimum time between two warnings about the same fault, s."""
CLOCK_STEP_NS = 60 * 10**9
"""Step of the clock when it is set back, ns."""
LOST_S = 10.0
"""Time without poses, s."""
FAST_DDS_PROFILE = Path(__file__).with_name("fastdds.xml")
"""Settings of Fast DDS, the default middleware of ROS 2, unless the user has some of his own."""
WORLD = "home"
"""Frame of the true pose."""


class RobotNode:
    """Publishers, subscriptions and services of the robot.

    Args:
        robot: The robot.
        rate_hz: Maximum number of frames per second.
    """

    def __init__(self, robot: SimulatedRobot, rate_hz: float) -> None:
        self._robot, self._period_s = robot, 1 / rate_hz
        self.node = node = rclpy.create_node("robot")
        self._colour = node.create_publisher(
            Image, "/camera/color/image_raw", qos_profile_sensor_data
        )
        self._depth = node.create_publisher(
            Image, "/camera/aligned_depth_to_color/image_raw", qos_profile_sensor_data
        )
        self._info = node.create_publisher(
            CameraInfo, "/camera/color/camera_info", qos_profile_sensor_data
        )
        self._labels = node.create_publisher(Image, "/camera/labels", qos_profile_sensor_data)
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self._label_names = node.create_publisher(String, "/camera/label_names", latched)
        self._label_names.publish(String(data=json.dumps(robot.label_names)))
        self._odometry = node.create_publisher(Odometry, "/odom", QUEUE)
        self._camera_pose = node.create_publisher(PoseStamped, "/camera/pose", QUEUE)
        self._true_pose = node.create_publisher(PoseStamped, "/robot/true_pose", QUEUE)
        self._send_transforms = _transform_sender(node)
        self._start_ns: int = node.get_clock().now().nanoseconds
        self._start_s = time.monotonic()
        self._latest = robot.state, self._start_ns
        node.create_timer(TICK_S, self._catch_up)
        node.create_subscription(PoseStamped, "/goal_pose", self._on_goal, QUEUE)
        node.create_subscription(
            Float64MultiArray, "/tilt_controller/commands", self._on_tilt, QUEUE
        )
        self._poses_from_s = 0.0
        for name, follow in (
            ("carry_away", self._carry_away),
            ("set_clock_back", self._set_clock_back),
            ("lose_poses", self._lose_poses),
        ):
            node.create_service(Trigger, f"/robot/{name}", follow)

    def send_images(self, stopped: threading.Event) -> None:
        """Publish frames until the robot is stopped.

        Args:
            stopped: Set by another thread.
        """
        due_s = time.monotonic()
        while not stopped.wait(max(0.0, due_s - time.monotonic())):
            due_s = max(due_s + self._period_s, time.monotonic())
            state, stamp = self._latest
            frame = self._robot.observe(state)
            self._info.publish(messages.camera_info(frame.camera, stamp))
            if frame.labels is not None and self._labels.get_subscription_count():
                self._labels.publish(messages.label_image(frame.labels.instances, stamp))
            self._depth.publish(messages.depth_image(frame.depth, stamp))
            header = messages.header(stamp, messages.OPTICAL)
            self._colour.publish(image_message(header, frame.rgb))

    def _catch_up(self) -> None:
        """Let the ticks pass that are due, and publish the poses of each."""
        due = int((time.monotonic() - self._start_s) / TICK_S) - self._robot.state.tick
        if due > MAX_LAG_TICKS:
            self._start_s += (due - 1) * TICK_S
            self._start_ns += (due - 1) * TICK_NS
            due = 1
        for _ in range(due):
            state = self._robot.advance()
            self._latest = state, self._start_ns + state.tick * TICK_NS
            self._publish_poses(*self._latest)

    def _publish_poses(self, state: RobotState, stamp: int) -> None:
        base, mount = state.believed.matrix(), base_from_camera(state.tilt_rad)
        true = product(state.true.matrix(self._robot.floor_m), mount)
        in_world = messages.header(stamp, WORLD)
        self._true_pose.publish(PoseStamped(header=in_world, pose=pose_message(true)))
        if time.monotonic() < self._poses_from_s:
            return
        in_odom, in_base = (
            messages.header(stamp, frame) for frame in (messages.ODOM, messages.BASE)
        )
        self._odometry.publish(messages.odometry(base, state.speed_m_s, state.turn_rad_s, stamp))
        pose = pose_message(product(base, mount))
        self._camera_pose.publish(PoseStamped(header=in_odom, pose=pose))
        self._send_transforms(
            [
                transform_message(in_odom, messages.BASE, base),
                transform_message(in_base, messages.OPTICAL, mount),
            ]
        )

    def _on_goal(self, message: Any) -> None:
        frame = message.header.frame_id
        if frame != messages.ODOM:
            self._warn(
                f"/goal_pose: ignored: expected frame_id {messages.ODOM}, got {frame[:80]!r}"
            )
            return
        try:
            goal = messages.planar_pose(message.pose)
        except ValueError as error:
            self._warn(f"/goal_pose: ignored: {error}")
            return
        if reason := self._robot.go_to(goal):
            self._warn(f"/goal_pose: the robot stays: {reason}")

    def _on_tilt(self, message: Any) -> None:
        if len(message.data) != 1 or not np.isfinite(message.data[0]):
            self._warn("/tilt_controller/commands: ignored: expected one finite angle, rad")
            return
        self._robot.tilt(message.data[0])

    def _carry_away(self, _: Any, response: Any) -> Any:
        self._robot.carry_away()
        response.success, response.message = True, "the robot was put down elsewhere"
        return response

    def _set_clock_back(self, _: Any, response: Any) -> Any:
        self._start_ns -= CLOCK_STEP_NS
        response.success, response.message = True, "the clock was set back by a minute"
        return response

    def _lose_poses(self, _: Any, response: Any) -> Any:
        self._poses_from_s = time.monotonic() + LOST_S
        response.success, response.message = True, f"no poses come for {LOST_S:g} s"
        return response

    def _warn(self, text: str) -> None:
        self.node.get_logger().warning(text, throttle_duration_sec=LOG_S)


def spin(
    robot: SimulatedRobot,
    rate_hz: float,
    interval_s: float | None,
    should_stop: Callable[[], bool],
) -> None:
    """Run the nodes of robot and home until they are stopped.

    Motion, goals and tilts are handled in one thread, changes in another one, and images are
    rendered in a third one: receiving never waits for rendering.

    Args:
        robot: The robot.
        rate_hz: Maximum number of frames per second.
        interval_s: Time between changes that happen by themselves, s; None for none.
        should_stop: Asked several times a second.
    """
    os.environ.setdefault("FASTRTPS_DEFAULT_PROFILES_FILE", str(FAST_DDS_PROFILE))
    # The signal handlers of rclpy would end publishers while they are in use.
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    robot_node, home_node = RobotNode(robot, rate_hz), HomeNode(robot, interval_s)
    moving, changing = executors = SingleThreadedExecutor(), SingleThreadedExecutor()
    moving.add_node(robot_node.node)
    changing.add_node(home_node.node)
    stopped = threading.Event()
    with ThreadPoolExecutor(2) as pool:
        lanes = [
            pool.submit(robot_node.send_images, stopped),
            pool.submit(_spin_until, changing, stopped.is_set),
        ]
        try:
            _spin_until(moving, lambda: should_stop() or any(lane.done() for lane in lanes))
        finally:
            stopped.set()
            wait(lanes)
            for executor in executors:
                executor.shutdown()
            robot_node.node.destroy_node()
            home_node.node.destroy_node()
            rclpy.shutdown()
    for lane in lanes:
        lane.result()


def _spin_until(executor: SingleThreadedExecutor, is_over: Callable[[], bool]) -> None:
    while not is_over():
        executor.spin_once(timeout_sec=POLL_S)


def _transform_sender(node: Any) -> Callable[[list[Any]], None]:
    """Return a function that publishes transforms where tf2_msgs is installed."""
    try:
        from tf2_msgs.msg import TFMessage
    except ImportError:
        return lambda _: None
    publisher = node.create_publisher(TFMessage, "/tf", 100)
    return lambda transforms: publisher.publish(TFMessage(transforms=transforms))
