"""Subscriptions of the node: poses, and serialized images."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Odometry
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from std_msgs.msg import String

from gslts.ros.config import NodeConfig
from gslts.ros.intake import Intake
from gslts.ros.live_poses import LivePoses, NoPoses, TfPoses, TopicPoses
from gslts.ros.problems import Problems

TF_DEPTH = 100
"""Depth of the queues of tf, as in tf2_ros."""
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Late subscribers get the last message, as Nav2 and RViz expect of maps."""


class Subscriptions:
    """Receives what the robot publishes.

    Images stay serialized until a frame is needed: at 30 Hz most of them are never decoded.

    Args:
        node: Of ROS.
        config: Settings.
        problems: Gets what is wrong with messages.

    Attributes:
        poses: Of the camera.
        intake: Frames of the camera.

    Raises:
        ImportError: The poses should come from tf, and this ROS lacks tf2_msgs.
    """

    def __init__(self, node: Node, config: NodeConfig, problems: Problems) -> None:
        self._node, self._config, self._problems = node, config, problems
        self._expected: dict[str, Any] = {}
        self.poses = self._subscribe_poses()
        self.intake = Intake(config.topics, self.poses, self._decode, problems)
        self._types = self._subscribe_images()
        self._expected |= self._types

    def check(self) -> None:
        """Report topics that nobody publishes, of another type, or of several publishers."""
        for topic, kind in self._expected.items():
            expected = f"{kind.__module__.partition('.')[0]}/msg/{kind.__name__}"
            name = self._node.resolve_topic_name(topic)
            found = self._node.get_publishers_info_by_topic(name)
            others = {each.topic_type for each in found} - {expected}
            if not found:
                self._problems.report(topic, "nobody publishes it")
            elif others:
                self._problems.report(topic, f"expected {expected}, got {', '.join(others)}")
            elif len(found) > 1:
                nodes = ", ".join(sorted(each.node_name for each in found))
                self._problems.report(topic, f"{len(found)} nodes publish it: {nodes}")

    def _subscribe_poses(self) -> LivePoses:
        """Subscribe to the source of poses: a topic if one is given, else tf, else none."""
        topics, node = self._config.topics, self._node
        topic, kind = topics.odometry or topics.pose, PoseStamped
        if topics.odometry:
            kind = Odometry
        if topic:
            from_topic = TopicPoses(self._config.mount)
            add = self._guard(topic, from_topic.add)
            node.create_subscription(kind, topic, add, qos_profile_sensor_data)
            self._expected[topic] = kind
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
        moving = self._guard("/tf", lambda message: tf.add(message, fixed=False))
        fixed = self._guard("/tf_static", lambda message: tf.add(message, fixed=True))
        node.create_subscription(TFMessage, "/tf", moving, QoSProfile(depth=TF_DEPTH))
        static = QoSProfile(depth=TF_DEPTH, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        node.create_subscription(TFMessage, "/tf_static", fixed, static)
        return tf

    def _subscribe_images(self) -> dict[str, Any]:
        """Subscribe to serialized images and intrinsics; return the types of the topics."""
        topics, node = self._config.topics, self._node
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
            names = self._guard(
                topics.label_names, lambda message: self.intake.add_label_names(message.data)
            )
            node.create_subscription(String, topics.label_names, names, LATCHED)
        return types

    def _decode(self, topic: str, message: bytes) -> Any:
        try:
            return deserialize_message(message, self._types[topic])
        except Exception as error:  # rclpy raises errors of any kind for damaged messages.
            raise ValueError(f"a message cannot be read: {error}") from None

    def _guard(self, topic: str, add: Callable[[Any], None]) -> Callable[[Any], None]:
        """Return a callback that reports what is wrong with a message."""

        def on_message(message: Any) -> None:
            try:
                add(message)
            except ValueError as error:
                self._problems.report(topic, str(error))

        return on_message


def _image_type(topic: str) -> Any:
    return CompressedImage if topic.endswith(("/compressed", "/compressedDepth")) else Image
