"""Poses of the camera over the last seconds, from a topic of poses or from tf."""

from __future__ import annotations

import math
import threading
from typing import Any, Protocol

import numpy as np

from gslts.datasets.dataset import rigid
from gslts.datasets.ros.poses import FrameTree, Track, frame_name, time_of
from gslts.ros.config import Mount
from gslts.ros.constants import CLOCK_JUMP_NS, MAX_POSE_GAP_NS, POSE_HISTORY_NS
from gslts.types import Floats

BASE = "base_link"
"""Frame of the robot in tf (REP 105), which goals are for."""
TRIM_PERIOD_NS = 1_000_000_000
"""Time between two removals of old transforms. At each transform, they take 4 % of a core with 30
joints at 50 Hz, and four times as much with 60."""


class LivePoses(Protocol):
    """Source of the poses that the robot believes.

    Attributes:
        world: Name of the frame in which the poses are.
    """

    world: str

    def at(self, time_ns: int, frame: str) -> Floats:
        """Return the pose of the camera at a time.

        Args:
            time_ns: Time, ns.
            frame: Optical frame of the camera.

        Returns:
            [4,4] world_from_camera, m.

        Raises:
            ValueError: The pose at that time is not known, or not yet.
        """
        ...

    def latest(self, frame: str) -> Floats:
        """Return the newest pose of the camera; see `at`.

        Args:
            frame: Optical frame of the camera.
        """
        ...

    def base_from_camera(self, frame: str) -> Floats | None:
        """Return the pose of the camera on the robot, [4,4], m; None if it is not known.

        Args:
            frame: Optical frame of the camera.
        """
        ...


class NoPoses:
    """Poses of a camera without odometry: all the same."""

    world = ""

    def at(self, time_ns: int, frame: str) -> Floats:  # noqa: ARG002
        """Return the identity; see `LivePoses.at`.

        Args:
            time_ns: Any time, ns.
            frame: Any frame.
        """
        return np.eye(4)

    def latest(self, frame: str) -> Floats:  # noqa: ARG002
        """Raise ValueError: nobody knows if the camera moves; see `LivePoses.latest`.

        Args:
            frame: Any frame.
        """
        raise ValueError("there is no source of poses")

    def base_from_camera(self, frame: str) -> Floats | None:  # noqa: ARG002
        """Return None: nobody knows; see `LivePoses.base_from_camera`.

        Args:
            frame: Any frame.
        """
        return None


class TopicPoses:
    """Poses from messages Odometry or PoseStamped; see `LivePoses`.

    Args:
        mount: Pose of the camera in the frame that the messages are about; None for the identity.
    """

    def __init__(self, mount: Mount | None) -> None:
        self.world = ""
        self._mount = mount
        self._child = ""
        self._track = Track()
        self._lock = threading.Lock()

    def add(self, message: Any) -> None:
        """Add a message.

        Args:
            message: An Odometry or a PoseStamped.

        Raises:
            ValueError: The pose is not finite, its quaternion is zero, or its stamp is zero.
        """
        pose = getattr(message.pose, "pose", message.pose)
        time_ns = _stamp_of_pose(message.header, pose.position, pose.orientation)
        with self._lock:
            self.world = frame_name(message.header.frame_id)
            self._child = frame_name(getattr(message, "child_frame_id", ""))
            self._track.add(time_ns, pose.position, pose.orientation)
            self._track.keep(*_memory(self._track.newest_ns(), time_ns))

    def at(self, time_ns: int, frame: str) -> Floats:
        """Return the pose of the camera at a time; see `LivePoses.at`.

        Args:
            time_ns: Time, ns.
            frame: Optical frame of the camera.
        """
        with self._lock:
            mount = self._camera_mount(frame)
            return rigid(self._track.at(time_ns, MAX_POSE_GAP_NS) @ mount)

    def latest(self, frame: str) -> Floats:
        """Return the newest pose of the camera; see `LivePoses.latest`.

        Args:
            frame: Optical frame of the camera.
        """
        with self._lock:
            mount = self._camera_mount(frame)
            return rigid(self._track.at(self._track.newest_ns()) @ mount)

    def base_from_camera(self, frame: str) -> Floats | None:  # noqa: ARG002
        """Return the mount; see `LivePoses.base_from_camera`.

        Args:
            frame: Any frame.
        """
        return None if self._mount is None else mount_matrix(self._mount)

    def _camera_mount(self, frame: str) -> Floats:
        """Return [4,4] child_from_camera."""
        if self._mount is not None:
            return mount_matrix(self._mount)
        if self._child not in ("", frame):
            raise ValueError(
                f"the poses are of {self._child} and the images of {frame}: give --mount, or tf"
            )
        return np.eye(4)


class TfPoses:
    """Poses from messages of /tf and /tf_static; see `LivePoses`.

    Args:
        world: Frame in which the poses are wanted, such as map or odom.
    """

    def __init__(self, world: str) -> None:
        self.world = frame_name(world)
        self._tree = FrameTree(reparent=True)
        self._newest_ns = self._trimmed_ns = 0
        self._lock = threading.Lock()

    def add(self, message: Any, fixed: bool) -> None:
        """Add the transforms of a message.

        Args:
            message: A TFMessage.
            fixed: True for /tf_static.

        Raises:
            ValueError: A transform is not finite, or its quaternion is zero; the next ones are
                left out. Or a frame came to another parent, and all transforms are added.
        """
        conflict = None
        with self._lock:
            for transform in message.transforms:
                pose = transform.transform
                time_ns = _stamp_of_pose(
                    transform.header, pose.translation, pose.rotation, timeless=fixed
                )
                conflict = self._tree.add(transform, fixed) or conflict
                if not fixed:
                    self._keep(time_ns)
        if conflict is not None:
            raise ValueError(f"{conflict}; the last one holds")

    def _keep(self, time_ns: int) -> None:
        """Forget old transforms once a period, and at once if the clock was set back."""
        first_ns, self._newest_ns = _memory(self._newest_ns, time_ns)
        if not 0 <= self._newest_ns - self._trimmed_ns < TRIM_PERIOD_NS:
            self._tree.keep(first_ns, self._newest_ns)
            self._trimmed_ns = self._newest_ns

    def at(self, time_ns: int, frame: str) -> Floats:
        """Return the pose of the camera at a time; see `LivePoses.at`.

        Args:
            time_ns: Time, ns.
            frame: Optical frame of the camera.
        """
        with self._lock:
            return rigid(self._tree.find(self.world, frame, time_ns, MAX_POSE_GAP_NS))

    def latest(self, frame: str) -> Floats:
        """Return the newest pose of the camera; see `LivePoses.latest`.

        Args:
            frame: Optical frame of the camera.
        """
        with self._lock:
            newest_ns = self._tree.newest_ns(self.world, frame)
            return rigid(self._tree.find(self.world, frame, newest_ns))

    def base_from_camera(self, frame: str) -> Floats | None:
        """Return the transform from `BASE`; see `LivePoses.base_from_camera`.

        Args:
            frame: Optical frame of the camera.
        """
        with self._lock:
            try:
                newest_ns = self._tree.newest_ns(BASE, frame)
                return rigid(self._tree.find(BASE, frame, newest_ns, MAX_POSE_GAP_NS))
            except ValueError:
                return None


def mount_matrix(mount: Mount) -> Floats:
    """Return the transform of a mount.

    Args:
        mount: x y z, m, and roll pitch yaw, rad, about the fixed axes (URDF).

    Returns:
        [4,4] base_from_camera, m.
    """
    x, y, z, roll, pitch, yaw = mount
    (sr, sp, sy), (cr, cp, cy) = np.sin((roll, pitch, yaw)), np.cos((roll, pitch, yaw))
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr, x],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr, y],
            [-sp, cp * sr, cp * cr, z],
            [0, 0, 0, 1],
        ]
    )


def _memory(newest_ns: int, time_ns: int) -> tuple[int, int]:
    """Return first and last time that is remembered after a pose has come, ns.

    The last one is that of the newest pose, or of this one if the clock was set back.
    """
    last_ns = time_ns if time_ns < newest_ns - CLOCK_JUMP_NS else max(newest_ns, time_ns)
    return last_ns - POSE_HISTORY_NS, last_ns


def _stamp_of_pose(header: Any, position: Any, rotation: Any, *, timeless: bool = False) -> int:
    """Return the stamp of a pose, ns; raise ValueError if the pose or the stamp is invalid."""
    quaternion = rotation.x, rotation.y, rotation.z, rotation.w
    numbers = position.x, position.y, position.z, *quaternion
    if not (all(map(math.isfinite, numbers)) and any(quaternion)):
        raise ValueError("a pose is not finite, or its quaternion is zero")
    time_ns = time_of(header)
    if time_ns <= 0 and not timeless:
        raise ValueError("a pose has the stamp zero")
    return time_ns
