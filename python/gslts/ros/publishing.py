"""Topics on which the node publishes its results."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import Image
from std_msgs.msg import Header, String
from visualization_msgs.msg import MarkerArray

from gslts.core.gaussian_map import GaussianMap
from gslts.io.images import to_rgb8
from gslts.navigation.semantic_map import SemanticMap
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.ros.config import NodeConfig
from gslts.ros.constants import VIEW_PERIOD_S
from gslts.ros.grid_message import grid_message
from gslts.ros.image_message import image_message
from gslts.ros.judge import Judged
from gslts.ros.markers import change_markers
from gslts.ros.pose_message import localized_pose_message, transform_message
from gslts.ros.shown_change import ShownChange
from gslts.ros.statuses import Status
from gslts.ros.subscriptions import LATCHED

MAP_FRAME = "map"
"""Frame of all that the node publishes."""
QUEUE = 10
"""Depth of the queues of reliable topics."""
EVENTS = QoSProfile(depth=QUEUE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Late subscribers get the last events: which version of the map the node has loaded is one."""


class Publishing:
    """Publishes the results of the operation.

    Args:
        node: Of ROS.
        config: Settings.
        odometry_frame: Returns the name of the frame of the poses.

    Attributes:
        latencies_s: Of the last frames, from their stamps to the results.
        on_answer: Called with each answer.

    Raises:
        ImportError: The transform of the odometry should be published, and this ROS lacks tf2_msgs.
    """

    def __init__(self, node: Node, config: NodeConfig, odometry_frame: Callable[[], str]) -> None:
        self._node, self._config, self._odometry_frame = node, config, odometry_frame
        self._rasterizer, self._view_s = Rasterizer(np.float32), 0.0
        self.latencies_s: list[float] = []
        self.on_answer: Callable[[str], None] = lambda _: None
        self._markers = node.create_publisher(MarkerArray, "gslts/changes", LATCHED)
        self._grid = node.create_publisher(OccupancyGrid, "gslts/grid", LATCHED)
        self._pose = node.create_publisher(PoseWithCovarianceStamped, "gslts/pose", QUEUE)
        self._view = node.create_publisher(Image, "gslts/view", qos_profile_sensor_data)
        self._answers = node.create_publisher(String, "gslts/answer", QUEUE)
        self._events = node.create_publisher(String, "gslts/events", EVENTS)
        self._tf = self._publisher_of_tf() if config.publish_tf else None
        self._diagnostics, self._detections = None, None
        try:
            from diagnostic_msgs.msg import DiagnosticArray

            self._diagnostics = node.create_publisher(DiagnosticArray, "/diagnostics", QUEUE)
        except ImportError:
            node.get_logger().info("no /diagnostics: diagnostic_msgs cannot be imported")
        try:
            from vision_msgs.msg import Detection3DArray

            self._detections = node.create_publisher(Detection3DArray, "gslts/detections", LATCHED)
        except ImportError:
            node.get_logger().info("no gslts/detections: vision_msgs cannot be imported")

    def judged(self, judged: Judged, gaussian_map: GaussianMap | None) -> None:
        """Publish the pose of a frame, and a rendering there if somebody subscribes.

        Args:
            judged: Result for a frame.
            gaussian_map: Newest version of the map; None if there is none yet.
        """
        self.latencies_s = [*self.latencies_s[-99:], judged.latency_s]
        frame, found = judged.frame, judged.found
        if frame.fault is not None or gaussian_map is None:
            return
        header = self._header(MAP_FRAME, round(frame.time_s * 1e9))
        covariance = np.zeros((6, 6))
        if found is not None and found.covariance is not None:
            covariance = found.covariance
        if self._tf is not None and self._odometry_frame():
            from tf2_msgs.msg import TFMessage

            frame_id, correction = self._odometry_frame(), judged.map_from_odometry
            transform = transform_message(header, frame_id, correction)
            self._tf.publish(TFMessage(transforms=[transform]))
        pose = frame.camera.world_from_camera
        self._pose.publish(localized_pose_message(header, pose, covariance))
        is_due = abs(frame.time_s - self._view_s) > VIEW_PERIOD_S
        if self._view.get_subscription_count() and is_due:
            self._view_s = frame.time_s
            options = RenderOptions(threads=self._config.threads)
            rgb = self._rasterizer.forward(gaussian_map, frame.camera, options).rgb
            self._view.publish(image_message(header, to_rgb8(rgb)))

    def changes(self, shown: Sequence[ShownChange]) -> None:
        """Publish the changes of objects; they replace the earlier ones.

        Args:
            shown: Published and detected changes.
        """
        self._markers.publish(change_markers(MAP_FRAME, shown))
        if self._detections is not None:
            from gslts.ros.detections import detection_array

            self._detections.publish(detection_array(self._header(MAP_FRAME), shown))

    def grid(self, semantic_map: SemanticMap) -> None:
        """Publish the free floor.

        Args:
            semantic_map: Of the newest version.
        """
        self._grid.publish(grid_message(self._header(MAP_FRAME), semantic_map))

    def event(self, event: str, **values: Any) -> None:
        """Publish an event.

        Args:
            event: Its name.
            values: Values of JSON.
        """
        self._events.publish(String(data=json.dumps({"event": event, **values})))

    def answer(self, text: str) -> None:
        """Publish an answer.

        Args:
            text: JSON of one object on one line.
        """
        self._answers.publish(String(data=text))
        self.on_answer(text)

    def diagnostics(self, parts: Sequence[Status]) -> None:
        """Publish the state of the node.

        Args:
            parts: Of the node.
        """
        if self._diagnostics is not None:
            from gslts.ros.diagnostics import diagnostic_array

            name = str(self._config.map_path)
            self._diagnostics.publish(diagnostic_array(self._header(""), "gslts", name, parts))

    def _publisher_of_tf(self) -> Any:
        try:
            from tf2_msgs.msg import TFMessage
        except ImportError:
            raise ImportError("--publish-tf needs tf2_msgs, which this ROS lacks") from None
        return self._node.create_publisher(TFMessage, "/tf", QUEUE)

    def _header(self, frame: str, time_ns: int | None = None) -> Header:
        header = Header(frame_id=frame, stamp=self._node.get_clock().now().to_msg())
        if time_ns is not None:
            header.stamp.sec, header.stamp.nanosec = divmod(time_ns, 1_000_000_000)
        return header
