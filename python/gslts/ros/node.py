"""ROS 2 node `gslts`: subscriptions, publishers and goals."""

from __future__ import annotations

import json
import threading
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np

try:
    import rclpy
    from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
    from nav_msgs.msg import OccupancyGrid, Odometry
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
    from rclpy.serialization import deserialize_message
    from rclpy.signals import SignalHandlerOptions
    from sensor_msgs.msg import CameraInfo, CompressedImage, Image
    from std_msgs.msg import Float64MultiArray, Header, String
    from visualization_msgs.msg import MarkerArray
except ImportError as error:
    raise ImportError(f"{error}: source ROS 2 first, such as /opt/ros/jazzy/setup.bash") from error

from gslts.core.gaussian_map import GaussianMap
from gslts.io.images import to_rgb8
from gslts.navigation.semantic_map import SemanticMap
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.ros.answers import failure_answer, words_of
from gslts.ros.config import NodeConfig
from gslts.ros.constants import DIAGNOSTICS_PERIOD_S, VIEW_PERIOD_S
from gslts.ros.grid_message import grid_message
from gslts.ros.image_message import image_message
from gslts.ros.intake import Intake
from gslts.ros.judge import Judged
from gslts.ros.live_poses import LivePoses, NoPoses, TfPoses, TopicPoses
from gslts.ros.markers import change_markers
from gslts.ros.operation import Operation
from gslts.ros.pose_message import localized_pose_message, pose_message, transform_message
from gslts.ros.problems import Problems
from gslts.ros.requests import Kind, Request
from gslts.ros.robot import yaw_pose
from gslts.ros.shown_change import ShownChange
from gslts.ros.statuses import statuses
from gslts.types import Floats

MAP_FRAME = "map"
"""Frame of all that the node publishes."""
QUEUE = 10
"""Depth of the queues of reliable topics."""
OWN_GOALS = 8
"""Number of last goals of the node by which it knows its own messages when it receives them."""
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Late subscribers get the last message, as Nav2 and RViz expect of maps."""


class GsltsNode:
    """The node; also the `Outbox` and the `Goals` of the operation.

    Args:
        config: Settings.
        stop: Set if the node should end.
    """

    def __init__(self, config: NodeConfig, stop: threading.Event) -> None:
        self.node = node = rclpy.create_node("gslts")
        self._config = config
        logger = node.get_logger()
        self._problems = Problems(logger.warning)
        self._poses = self._subscribe_poses()
        self.intake = Intake(config.topics, self._poses, self._decode, self._problems)
        self._types = self._subscribe_images()
        self._publish_as()
        self._typed: Any = None
        self._own_goals = deque[tuple[float, float]](maxlen=OWN_GOALS)
        self._rasterizer, self._view_s = Rasterizer(np.float32), 0.0
        self._latencies_s: list[float] = []
        self.operation = Operation(
            config, self.intake, self, self, self._problems, stop, self.now_s, logger.info
        )
        for topic, kind in (("query", "query"), ("go", "go"), ("command", "command")):
            node.create_subscription(
                String, f"gslts/{topic}", lambda m, k=kind: self._on_words(k, m.data), QUEUE
            )
        node.create_subscription(PoseStamped, "goal_pose", self._on_goal, QUEUE)
        node.create_timer(DIAGNOSTICS_PERIOD_S, self._diagnose)

    def now_s(self) -> float:
        """Return the time of the clock of ROS, s; with use_sim_time, that of the simulation."""
        return float(self.node.get_clock().now().nanoseconds * 1e-9)

    # Receiving -----------------------------------------------------------------------------------

    def _subscribe_poses(self) -> LivePoses:
        """Subscribe to the source of poses: a topic if one is given, else tf, else none."""
        topics, node = self._config.topics, self.node
        topic, kind = topics.odometry or topics.pose, PoseStamped
        if topics.odometry:
            kind = Odometry
        if topic:
            from_topic = TopicPoses(self._config.mount)
            add = self._guarded(topic, from_topic.add)
            node.create_subscription(kind, topic, add, qos_profile_sensor_data)
            return from_topic
        try:
            from tf2_msgs.msg import TFMessage
        except ImportError:
            if not self._config.locate:
                raise ImportError(
                    "poses from tf need tf2_msgs, which this ROS lacks: give --odometry or "
                    "--pose, or --locate"
                ) from None
            return NoPoses()
        tf = TfPoses(self._config.world)
        moving = self._guarded("/tf", lambda message: tf.add(message, fixed=False))
        fixed = self._guarded("/tf_static", lambda message: tf.add(message, fixed=True))
        node.create_subscription(TFMessage, "/tf", moving, QoSProfile(depth=100))
        static = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        node.create_subscription(TFMessage, "/tf_static", fixed, static)
        return tf

    def _subscribe_images(self) -> dict[str, Any]:
        """Subscribe to serialized images and intrinsics; return the types of the topics."""
        topics, node = self._config.topics, self.node
        images = [topics.rgb, topics.depth, *filter(None, [topics.labels])]
        infos = [topics.rgb_info, *filter(None, [topics.depth_info])]
        types = {name: _image_type(name) for name in images}
        types |= dict.fromkeys(infos, CameraInfo)
        for name, kind in types.items():
            add = self.intake.add_info if name in infos else self.intake.add_image
            node.create_subscription(
                kind, name, lambda m, a=add, n=name: a(n, m), qos_profile_sensor_data, raw=True
            )
        if topics.label_names:
            names = self._guarded(
                topics.label_names, lambda message: self.intake.add_label_names(message.data)
            )
            node.create_subscription(String, topics.label_names, names, LATCHED)
        return types

    def _decode(self, topic: str, message: bytes) -> Any:
        try:
            return deserialize_message(message, self._types[topic])
        except Exception as error:  # rclpy raises errors of any kind for damaged messages.
            raise ValueError(f"a message cannot be read: {error}") from None

    def _guarded(self, topic: str, add: Callable[[Any], None]) -> Callable[[Any], None]:
        """Return a callback that reports what is wrong with a message."""

        def on_message(message: Any) -> None:
            try:
                add(message)
            except ValueError as error:
                self._problems.report(topic, str(error))

        return on_message

    def _on_words(self, kind: Kind, text: str) -> None:
        try:
            words = words_of(text)
            if kind == "query":
                self.operation.ask(words)
            else:
                self.operation.requests.add(Request(kind, words))
        except ValueError as error:
            self.answer(failure_answer(kind, text, str(error)))

    def _on_goal(self, message: PoseStamped) -> None:
        """Leave the robot alone if somebody else gave it a goal."""
        position = message.pose.position
        if (position.x, position.y) not in self._own_goals and self.operation.robot is not None:
            self.operation.robot.leave_alone()

    # Goals ---------------------------------------------------------------------------------------

    def drive_to(self, position: Floats, yaw_rad: float) -> None:
        """Publish a goal; see `Goals.drive_to`."""
        message = PoseStamped(header=self._header(self._poses.world))
        message.pose = pose_message(yaw_pose(position, yaw_rad))
        self._own_goals.append((message.pose.position.x, message.pose.position.y))
        self._goals.publish(message)

    def tilt_to(self, pitch_rad: float) -> None:
        """Publish the angle of the camera; see `Goals.tilt_to`."""
        if self._tilt is not None:
            self._tilt.publish(Float64MultiArray(data=[pitch_rad]))

    # Publishing ----------------------------------------------------------------------------------

    def _publish_as(self) -> None:
        node, tilt = self.node, self._config.topics.tilt
        self._goals = node.create_publisher(PoseStamped, "goal_pose", QUEUE)
        self._tilt = node.create_publisher(Float64MultiArray, tilt, QUEUE) if tilt else None
        self._markers = node.create_publisher(MarkerArray, "gslts/changes", LATCHED)
        self._grid = node.create_publisher(OccupancyGrid, "gslts/grid", LATCHED)
        self._pose = node.create_publisher(PoseWithCovarianceStamped, "gslts/pose", QUEUE)
        self._view = node.create_publisher(Image, "gslts/view", qos_profile_sensor_data)
        self._answers = node.create_publisher(String, "gslts/answer", QUEUE)
        self._events = node.create_publisher(String, "gslts/events", QUEUE)
        self._tf: Any = self._publisher_of_tf() if self._config.publish_tf else None
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

    def _publisher_of_tf(self) -> Any:
        try:
            from tf2_msgs.msg import TFMessage
        except ImportError:
            raise ImportError("--publish-tf needs tf2_msgs, which this ROS lacks") from None
        return self.node.create_publisher(TFMessage, "/tf", QUEUE)

    def _publish_tf(self, header: Header, map_from_odometry: Floats) -> None:
        from tf2_msgs.msg import TFMessage

        transform = transform_message(header, self._poses.world, map_from_odometry)
        self._tf.publish(TFMessage(transforms=[transform]))

    def judged(self, judged: Judged, gaussian_map: GaussianMap | None) -> None:
        """Publish the pose of a frame, and a rendering there; see `Outbox.judged`."""
        self._latencies_s = [*self._latencies_s[-99:], judged.latency_s]
        frame, found = judged.frame, judged.found
        if frame.fault is not None or gaussian_map is None:
            return
        stamp_ns = round(frame.time_s * 1e9)
        header = self._header(MAP_FRAME, stamp_ns)
        covariance = np.zeros((6, 6))
        if found is not None and found.covariance is not None:
            covariance = found.covariance
        if self._tf is not None and self._poses.world:
            self._publish_tf(header, judged.map_from_odometry)
        pose = frame.camera.world_from_camera
        self._pose.publish(localized_pose_message(header, pose, covariance))
        now_s = self.now_s()
        if self._view.get_subscription_count() and abs(now_s - self._view_s) > VIEW_PERIOD_S:
            self._view_s = now_s
            options = RenderOptions(threads=self._config.threads)
            rgb = self._rasterizer.forward(gaussian_map, frame.camera, options).rgb
            self._view.publish(image_message(header, to_rgb8(rgb)))

    def changes(self, shown: Sequence[ShownChange]) -> None:
        """Publish the changes of objects; see `Outbox.changes`."""
        self._markers.publish(change_markers(MAP_FRAME, shown))
        if self._detections is not None:
            from gslts.ros.detections import detection_array

            self._detections.publish(detection_array(self._header(MAP_FRAME), shown))

    def grid(self, semantic_map: SemanticMap) -> None:
        """Publish the free floor; see `Outbox.grid`."""
        self._grid.publish(grid_message(self._header(MAP_FRAME), semantic_map))

    def event(self, event: str, **values: Any) -> None:
        """Publish an event; see `Outbox.event`."""
        self._events.publish(String(data=json.dumps({"event": event, **values})))

    def answer(self, text: str) -> None:
        """Publish an answer; see `Outbox.answer`."""
        self._answers.publish(String(data=text))
        if self._typed is not None:
            self._typed.on_answer(text)

    @contextmanager
    def typed_requests(self) -> Iterator[None]:
        """Answer the service and the action of gslts_msgs too, where it can be imported."""
        try:
            from gslts.ros.typed_requests import TypedRequests
        except ImportError:
            yield
            return
        with TypedRequests(self.operation) as self._typed:
            yield

    def _diagnose(self) -> None:
        if self._diagnostics is None:
            return
        from gslts.ros.diagnostics import diagnostic_array

        problems, state = self._problems.present(), self.operation.status()
        parts = statuses(self.intake.counts, self._latencies_s, problems, state)
        self._diagnostics.publish(
            diagnostic_array(self._header(""), "gslts", str(self._config.map_path), parts)
        )

    def _header(self, frame: str, time_ns: int | None = None) -> Header:
        header = Header(frame_id=frame, stamp=self.node.get_clock().now().to_msg())
        if time_ns is not None:
            header.stamp.sec, header.stamp.nanosec = divmod(time_ns, 1_000_000_000)
        return header


def run_node(config: NodeConfig, stop: threading.Event) -> None:
    """Run the node until a stop is requested.

    Args:
        config: Settings.
        stop: Set if the node should end at the next safe point.

    Raises:
        OSError: A file cannot be read or written.
        ValueError: There is no map and none should be built, or it is damaged.
        RuntimeError: A lane failed.
    """
    # The signal handlers of rclpy would end publishers while they are in use.
    try:
        arguments = list(config.ros_arguments)
        rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    except RuntimeError as error:
        given, reason = " ".join(config.ros_arguments), str(error).partition(", at ")[0]
        raise ValueError(f"arguments of ROS: {given}: {reason}") from None
    executor = SingleThreadedExecutor()
    try:
        gslts_node = GsltsNode(config, stop)
        executor.add_node(gslts_node.node)
        spinning = threading.Thread(target=executor.spin, name="gslts-ros", daemon=True)
        spinning.start()
        try:
            with gslts_node.typed_requests():
                gslts_node.operation.run()
        finally:
            executor.shutdown()
            spinning.join()
            gslts_node.node.destroy_node()
    finally:
        rclpy.shutdown()


def _image_type(topic: str) -> Any:
    return CompressedImage if topic.endswith(("/compressed", "/compressedDepth")) else Image
