"""ROS 2 node that asks the simulated robot and gslts for the steps of a day, and records a bag."""

from __future__ import annotations

import json
import queue
import subprocess
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Self

import numpy as np

try:
    import rclpy
    from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
    from nav_msgs.msg import OccupancyGrid
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
    from rclpy.signals import SignalHandlerOptions
    from sensor_msgs.msg import Image
    from std_msgs.msg import String
    from std_srvs.srv import Trigger
    from visualization_msgs.msg import MarkerArray
except ImportError as error:
    raise ImportError(
        f"{error}: source ROS 2 first, such as /opt/ros/jazzy/setup.bash, or use the interpreter "
        "of `scripts/setup ros`"
    ) from error
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from gslts.datasets.poses import inverse, pose_from_quat
from gslts.types import Floats

LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
EVENTS = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
RECORDED = {
    "/camera/pose": (PoseStamped, qos_profile_sensor_data),
    "/gslts/pose": (PoseWithCovarianceStamped, qos_profile_sensor_data),
    "/gslts/changes": (MarkerArray, LATCHED),
    "/gslts/grid": (OccupancyGrid, LATCHED),
    "/gslts/view": (Image, qos_profile_sensor_data),
    "/gslts/events": (String, EVENTS),
    "/gslts/answer": (String, QoSProfile(depth=100)),
}
"""Topics that go into the bag."""
TIMEOUT_S = 1200.0
"""Maximum time of a step: building a map on a busy machine takes minutes."""
RETRY_S = 2.0
"""Time after which a change is asked for again: the robot was in its way."""


class Director:
    """Speaks to the nodes; use it in a `with` statement.

    Args:
        bag: New folder.
        log: Called with each line that gslts says.

    Attributes:
        poses: Newest poses [4,4] by topic: as the odometry believes, and true.
        path: Positions (2,) of the localized camera, x and y in the map, m.
        grid: Newest free floor; None before the first one.
        processes: Nodes that are waited for, by name, as long as they run.
    """

    def __init__(self, bag: Path, log: Callable[[str], None]) -> None:
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        self._node = node = rclpy.create_node("director")
        self._log = log
        self._said: queue.Queue[dict[str, Any]] = queue.Queue()
        self.poses: dict[str, Floats] = {}
        self.path: list[Floats] = []
        self.grid: Any = None
        self.processes: dict[str, subprocess.Popen[bytes]] = {}
        self._writer = Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP)
        self._writer.open()
        for topic, (kind, qos) in RECORDED.items():
            self._record(topic, kind, qos)
        node.create_subscription(String, "/gslts/events", self._on_text, EVENTS)
        node.create_subscription(String, "/gslts/answer", self._on_text, 100)
        node.create_subscription(PoseWithCovarianceStamped, "/gslts/pose", self._on_pose, 10)
        node.create_subscription(OccupancyGrid, "/gslts/grid", self._on_grid, LATCHED)
        for topic in ("/camera/pose", "/robot/true_pose"):
            node.create_subscription(
                PoseStamped, topic, lambda m, t=topic: self._on_stamped(t, m), 10
            )
        self._words = {
            kind: node.create_publisher(String, f"/gslts/{kind}", 10)
            for kind in ("query", "go", "command")
        }
        self._services = {
            name: node.create_client(Trigger, f"/robot/{name}")
            for name in ("change", "carry_away", "set_clock_back", "lose_poses")
        }
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(node)
        self._thread = threading.Thread(target=self._executor.spin)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._executor.shutdown()
        self._thread.join()
        self._writer.close()
        self._node.destroy_node()
        rclpy.shutdown()

    def wait(self, key: str, value: str) -> dict[str, Any]:
        """Wait for an event or an answer.

        Args:
            key: Of the JSON object.
            value: That it must have.

        Returns:
            The object.

        Raises:
            RuntimeError: A request failed, or a node has ended.
            TimeoutError: Nothing came.
        """
        end_s = time.monotonic() + TIMEOUT_S
        while time.monotonic() < end_s:
            self._require_running()
            try:
                said = self._said.get(timeout=1)
            except queue.Empty:
                continue
            if said.get("event") == "log":
                self._log(f"  {said['line']}")
            if said.get(key) == value:
                return said
            if said.get("status") == "failed":
                raise RuntimeError(f"{said}")
        raise TimeoutError(f"no message with {key} {value} came within {TIMEOUT_S:g} s")

    def say(self, kind: str, words: str) -> None:
        """Publish words, when there is a node that receives them.

        Args:
            kind: "query", "go" or "command".
            words: To say.

        Raises:
            TimeoutError: There is none.
        """
        end_s = time.monotonic() + TIMEOUT_S
        while not self._words[kind].get_subscription_count():
            if time.monotonic() > end_s:
                raise TimeoutError(f"no node receives /gslts/{kind}")
            time.sleep(0.1)
        self._words[kind].publish(String(data=words))

    def ask_robot(self, service: str) -> str:
        """Call a service of the robot, again and again while it is not possible.

        Args:
            service: "change", "carry_away", "set_clock_back" or "lose_poses".

        Returns:
            Its message.

        Raises:
            TimeoutError: It was not possible for too long.
        """
        end_s = time.monotonic() + TIMEOUT_S
        while time.monotonic() < end_s:
            if self._services[service].wait_for_service(RETRY_S):
                done = threading.Event()
                future = self._services[service].call_async(Trigger.Request())
                future.add_done_callback(lambda _, event=done: event.set())
                # Asked again before it answered, a busy robot would obey twice.
                if done.wait(end_s - time.monotonic()) and future.result().success:
                    return str(future.result().message)
            time.sleep(RETRY_S)
        raise TimeoutError(f"the robot did not obey /robot/{service} within {TIMEOUT_S:g} s")

    def odometry_from_world(self) -> Floats:
        """Return [4,4] of the simulated home, m; call it before the robot moves.

        Raises:
            RuntimeError: A node has ended.
        """
        while len(self.poses) < 2:
            self._require_running()
            time.sleep(0.1)
        return self.poses["/camera/pose"] @ inverse(self.poses["/robot/true_pose"])

    def _require_running(self) -> None:
        for name, process in self.processes.items():
            if process.poll() is not None:
                raise RuntimeError(f"{name} has ended; see its log")

    def _record(self, topic: str, kind: Any, qos: QoSProfile) -> None:
        package = kind.__module__.partition(".msg.")[0]
        connection = self._writer.add_connection(
            topic, f"{package}/msg/{kind.__name__}", typestore=get_typestore(Stores.ROS2_HUMBLE)
        )
        self._node.create_subscription(
            kind, topic, lambda m: self._writer.write(connection, time.time_ns(), m), qos, raw=True
        )

    def _on_text(self, message: String) -> None:
        self._said.put(json.loads(message.data))

    def _on_stamped(self, topic: str, message: PoseStamped) -> None:
        p, q = message.pose.position, message.pose.orientation
        self.poses[topic] = pose_from_quat((q.w, q.x, q.y, q.z), (p.x, p.y, p.z))

    def _on_pose(self, message: PoseWithCovarianceStamped) -> None:
        position = message.pose.pose.position
        self.path.append(np.array([position.x, position.y]))

    def _on_grid(self, message: OccupancyGrid) -> None:
        self.grid = message
