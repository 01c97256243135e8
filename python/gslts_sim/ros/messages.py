"""ROS messages of the simulated robot."""

from __future__ import annotations

import array
from typing import Any

import numpy as np
from geometry_msgs.msg import PoseStamped, TransformStamped
from nav_msgs.msg import Odometry
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header

from gslts.core.camera import Camera
from gslts.types import Bytes, Floats, Floats32
from gslts_sim.ros.planar_pose import PlanarPose

OPTICAL = "camera_color_optical_frame"
"""Frame of the images."""
BASE, ODOM = "base_link", "odom"
"""Frames of the robot and of its odometry (REP 105)."""
MAX_DEPTH_M = 65.535
"""Largest depth in a 16UC1 image, m."""


def header(time_ns: int, frame: str) -> Any:
    """Return a Header.

    Args:
        time_ns: Stamp, ns.
        frame: Frame id.
    """
    result = Header(frame_id=frame)
    result.stamp.sec, result.stamp.nanosec = divmod(time_ns, 10**9)
    return result


def colour_image(rgb: Bytes, time_ns: int) -> Any:
    """Return an Image with encoding rgb8.

    Args:
        rgb: [H,W,3] uint8.
        time_ns: Stamp, ns.
    """
    return _image(rgb, "rgb8", time_ns)


def depth_image(depth: Floats32, time_ns: int) -> Any:
    """Return an Image with encoding 16UC1.

    Args:
        depth: [H,W] m; 0 where there is no measurement.
        time_ns: Stamp, ns.
    """
    known = np.where(depth <= MAX_DEPTH_M, depth, 0)
    return _image(np.rint(1000 * known).astype("<u2"), "16UC1", time_ns)


def label_image(instances: NDArray[np.int32], time_ns: int) -> Any:
    """Return the object at each pixel as an Image with encoding 16UC1; 0 for none.

    Args:
        instances: [H,W] row of the object, -1 for none.
        time_ns: Stamp, ns.
    """
    return _image((instances + 1).astype("<u2"), "16UC1", time_ns)


def camera_info(camera: Camera, time_ns: int) -> Any:
    """Return the CameraInfo of an image without distortion.

    Args:
        camera: Its intrinsics.
        time_ns: Stamp, ns.
    """
    # Pixel centres: whole numbers in ROS, +0.5 in this project.
    fx, fy, cx, cy = camera.fx, camera.fy, camera.cx - 0.5, camera.cy - 0.5
    return CameraInfo(
        header=header(time_ns, OPTICAL),
        width=camera.width,
        height=camera.height,
        distortion_model="plumb_bob",
        d=[0.0] * 5,
        k=[fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0],
        r=np.eye(3).ravel(),
        p=[fx, 0.0, cx, 0.0, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0],
    )


def pose_stamped(pose: Floats, time_ns: int, frame: str) -> Any:
    """Return a PoseStamped.

    Args:
        pose: [4,4] in the frame, m.
        time_ns: Stamp, ns.
        frame: Frame id.
    """
    result = PoseStamped(header=header(time_ns, frame))
    _fill_pose(pose, result.pose.position, result.pose.orientation)
    return result


def odometry(pose: Floats, speed_m_s: float, turn_rad_s: float, time_ns: int) -> Any:
    """Return an Odometry.

    Args:
        pose: [4,4] odom_from_base, m.
        speed_m_s: Along x of the base, m/s.
        turn_rad_s: About z of the base, rad/s.
        time_ns: Stamp, ns.
    """
    result = Odometry(header=header(time_ns, ODOM), child_frame_id=BASE)
    _fill_pose(pose, result.pose.pose.position, result.pose.pose.orientation)
    result.twist.twist.linear.x = speed_m_s
    result.twist.twist.angular.z = turn_rad_s
    return result


def transform(pose: Floats, time_ns: int, parent: str, child: str) -> Any:
    """Return a TransformStamped.

    Args:
        pose: [4,4] parent_from_child, m.
        time_ns: Stamp, ns.
        parent: Frame id.
        child: Frame id.
    """
    result = TransformStamped(header=header(time_ns, parent), child_frame_id=child)
    _fill_pose(pose, result.transform.translation, result.transform.rotation)
    return result


def planar_pose(pose: Any) -> PlanarPose:
    """Return position and heading of a Pose.

    Args:
        pose: Its roll and pitch are ignored.

    Raises:
        ValueError: A number is not finite, or the quaternion has not length 1.
    """
    quaternion = np.array([getattr(pose.orientation, name) for name in "xyzw"])
    numbers = pose.position.x, pose.position.y
    if not (np.isfinite(numbers).all() and abs(float(np.linalg.norm(quaternion)) - 1) < 0.01):
        raise ValueError(f"position {numbers} and quaternion {quaternion.tolist()} are no pose")
    x, y, z, w = (quaternion / np.linalg.norm(quaternion)).tolist()
    return PlanarPose(*numbers, float(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))))


def _image(pixels: NDArray[Any], encoding: str, time_ns: int) -> Any:
    rows = np.ascontiguousarray(pixels)
    data = array.array("B")  # What rclpy takes without a check of each byte.
    data.frombytes(rows.tobytes())
    return Image(
        header=header(time_ns, OPTICAL),
        height=rows.shape[0],
        width=rows.shape[1],
        encoding=encoding,
        step=rows.strides[0],
        data=data,
    )


def _fill_pose(pose: Floats, position: Any, orientation: Any) -> None:
    position.x, position.y, position.z = pose[:3, 3].tolist()
    quaternion = Rotation.from_matrix(pose[:3, :3]).as_quat().tolist()
    orientation.x, orientation.y, orientation.z, orientation.w = quaternion
