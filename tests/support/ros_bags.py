"""Bags of a small robot, written with rosbags."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from gslts.core.camera import Camera

MOUNT = np.eye(4)
"""base_link_from_camera_link: above the base, looking down by 20 degrees and a bit to the left."""
MOUNT[:3, :3] = Rotation.from_euler("ZYX", [10, 20, 3], degrees=True).as_matrix()
MOUNT[:3, 3] = (0.1, 0.02, 0.4)
OPTICAL = np.eye(4)
"""camera_link_from_optical: x ahead, y left, z up against x right, y down, z ahead (REP 103)."""
OPTICAL[:3, :3] = [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]
OPTICAL[:3, 3] = (0.0, 0.015, 0.0)
MAP_FROM_ODOM = np.eye(4)
MAP_FROM_ODOM[:3, :3] = Rotation.from_euler("z", 70, degrees=True).as_matrix()
MAP_FROM_ODOM[:3, 3] = (1.0, -2.0, 0.0)
START_NS = 1_700_000_000_123_456_789


class Recorder:
    """Collects messages and writes them in one go."""

    def __init__(self) -> None:
        from rosbags.typesys import Stores, get_typestore

        self.store = get_typestore(Stores.ROS2_HUMBLE)
        self.messages: list[tuple[int, str, Any]] = []

    def make(self, kind: str, **fields: Any) -> Any:
        return self.store.types[kind](**fields)

    def header(self, time_ns: int, frame: str) -> Any:
        seconds, nanoseconds = divmod(time_ns, 10**9)
        stamp = self.make("builtin_interfaces/msg/Time", sec=seconds, nanosec=nanoseconds)
        return self.make("std_msgs/msg/Header", stamp=stamp, frame_id=frame)

    def add(self, topic: str, recorded_ns: int, message: Any) -> None:
        self.messages.append((recorded_ns, topic, message))

    def image(
        self, topic: str, time_ns: int, frame: str, encoding: str, pixels: np.ndarray, pad: int = 0
    ) -> None:
        """Recorded 30 ms later than taken, with rows longer by some bytes."""
        height, width = pixels.shape[:2]
        rows = np.ascontiguousarray(pixels).view(np.uint8).reshape(height, -1)
        rows = np.pad(rows, ((0, 0), (0, pad)), constant_values=99)
        message = self.make(
            "sensor_msgs/msg/Image",
            header=self.header(time_ns, frame),
            height=height,
            width=width,
            encoding=encoding,
            is_bigendian=int(pixels.dtype.byteorder == ">"),
            step=rows.shape[1],
            data=rows.ravel(),
        )
        self.add(topic, time_ns + 30_000_000, message)

    def compressed(self, topic: str, time_ns: int, frame: str, kind: str, data: bytes) -> None:
        message = self.make(
            "sensor_msgs/msg/CompressedImage",
            header=self.header(time_ns, frame),
            format=kind,
            data=np.frombuffer(data, np.uint8),
        )
        self.add(topic, time_ns + 30_000_000, message)

    def info(
        self,
        topic: str,
        camera: Camera,
        *,
        model: str = "plumb_bob",
        d: Iterable[float] = (0, 0, 0, 0, 0),
        **changed: Any,
    ) -> None:
        """In ROS the middle of the first pixel is (0, 0)."""
        k = [camera.fx, 0, camera.cx - 0.5, 0, camera.fy, camera.cy - 0.5, 0, 0, 1]
        p = [*k[:3], 0, *k[3:6], 0, *k[6:], 0]
        roi = {"x_offset": 0, "y_offset": 0, "height": 0, "width": 0, "do_rectify": False}
        fields = {
            "header": self.header(START_NS, ""),
            "height": camera.height,
            "width": camera.width,
            "distortion_model": model,
            "d": np.array(list(d), np.float64),
            "k": np.array(k, np.float64),
            "r": np.eye(3).ravel(),
            "p": np.array(p, np.float64),
            "binning_x": 0,
            "binning_y": 0,
            "roi": self.make("sensor_msgs/msg/RegionOfInterest", **roi),
        }
        self.add(topic, START_NS, self.make("sensor_msgs/msg/CameraInfo", **{**fields, **changed}))

    def _pose(self, pose: np.ndarray) -> tuple[dict, dict]:
        x, y, z = pose[:3, 3]
        quaternion = Rotation.from_matrix(pose[:3, :3]).as_quat()
        return {"x": x, "y": y, "z": z}, dict(zip("xyzw", quaternion, strict=True))

    def transform(self, time_ns: int, parent: str, child: str, pose: np.ndarray) -> Any:
        place, turn = self._pose(pose)
        return self.make(
            "geometry_msgs/msg/TransformStamped",
            header=self.header(time_ns, parent),
            child_frame_id=child,
            transform=self.make(
                "geometry_msgs/msg/Transform",
                translation=self.make("geometry_msgs/msg/Vector3", **place),
                rotation=self.make("geometry_msgs/msg/Quaternion", **turn),
            ),
        )

    def tf(self, topic: str, time_ns: int, *transforms: Any) -> None:
        message = self.make("tf2_msgs/msg/TFMessage", transforms=list(transforms))
        self.add(topic, time_ns, message)

    def pose(
        self, kind: str, topic: str, time_ns: int, parent: str, pose: np.ndarray, child: str = ""
    ) -> None:
        place, turn = self._pose(pose)
        message = self.make(
            "geometry_msgs/msg/Pose",
            position=self.make("geometry_msgs/msg/Point", **place),
            orientation=self.make("geometry_msgs/msg/Quaternion", **turn),
        )
        header, zeros = self.header(time_ns, parent), np.zeros(36)
        if kind != "geometry_msgs/msg/PoseStamped":
            of = "geometry_msgs/msg/PoseWithCovariance"
            message = self.make(of, pose=message, covariance=zeros)
        fields = {"header": header, "pose": message}
        if kind == "nav_msgs/msg/Odometry":
            zero = self.make("geometry_msgs/msg/Vector3", x=0.0, y=0.0, z=0.0)
            twist = self.make("geometry_msgs/msg/Twist", linear=zero, angular=zero)
            of = "geometry_msgs/msg/TwistWithCovariance"
            fields["twist"] = self.make(of, twist=twist, covariance=zeros)
            fields["child_frame_id"] = child
        self.add(topic, time_ns, self.make(kind, **fields))

    def write(self, folder: Path, storage: str) -> Path:
        from rosbags.rosbag2 import StoragePlugin, Writer

        plugin = StoragePlugin.MCAP if storage == "mcap" else StoragePlugin.SQLITE3
        connections: dict[str, Any] = {}
        with Writer(folder, version=9, storage_plugin=plugin) as writer:
            for recorded_ns, topic, message in sorted(self.messages, key=lambda m: m[0]):
                kind = message.__msgtype__
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, kind, typestore=self.store)
                data = self.store.serialize_cdr(message, kind)
                writer.write(connections[topic], recorded_ns, data)
        return folder


def moving(pose: np.ndarray, seconds: float) -> np.ndarray:
    """A pose some time later, at an even speed about axes of its own."""
    later = np.eye(4)
    turn = Rotation.from_rotvec(seconds * np.array([0.3, -0.4, 0.8])).as_matrix()
    later[:3, :3] = pose[:3, :3] @ turn
    later[:3, 3] = pose[:3, 3] + seconds * np.array([0.4, 0.3, 0.1])
    return later
