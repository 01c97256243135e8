"""ROS messages of the simulated robot."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from nav_msgs.msg import Odometry
from sensor_msgs.msg import CameraInfo, Image
from std_msgs.msg import Header

from gslts.core.camera import Camera
from gslts.ros.image_message import image_message
from gslts.ros.pose_message import pose_message
from gslts.types import Floats, Floats32, Ints32
from gslts_sim.ros.planar_pose import PlanarPose

OPTICAL = "camera_color_optical_frame"
"""Frame of the images."""
BASE, ODOM = "base_link", "odom"
"""Frames of the robot and of its odometry (REP 105)."""
MAX_DEPTH_M = 65.535
"""Largest depth in a 16UC1 image, m."""
MAX_GOAL_M = 1e4
"""Maximum distance of a goal from the start, m: beyond, it is a mistake in units."""


def header(time_ns: int, frame: str) -> Header:
    """Return a Header.

    Args:
        time_ns: Stamp, ns.
        frame: Frame id.
    """
    result = Header(frame_id=frame)
    result.stamp.sec, result.stamp.nanosec = divmod(time_ns, 10**9)
    return result


def depth_image(depth: Floats32, time_ns: int) -> Image:
    """Return an Image with encoding 16UC1.

    Args:
        depth: [H,W] m; 0 where there is no measurement.
        time_ns: Stamp, ns.
    """
    known = np.where(depth <= MAX_DEPTH_M, depth, 0)
    millimetres = np.rint(1000 * known).astype("<u2")
    return image_message(header(time_ns, OPTICAL), millimetres, "16UC1")


def label_image(instances: Ints32, time_ns: int) -> Image:
    """Return the object at each pixel as an Image with encoding 16UC1; 0 for none.

    Args:
        instances: [H,W] row of the object, -1 for none.
        time_ns: Stamp, ns.
    """
    return image_message(header(time_ns, OPTICAL), (instances + 1).astype("<u2"), "16UC1")


def camera_info(camera: Camera, time_ns: int) -> CameraInfo:
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


def odometry(pose: Floats, speed_m_s: float, turn_rad_s: float, time_ns: int) -> Odometry:
    """Return an Odometry.

    Args:
        pose: [4,4] odom_from_base, m.
        speed_m_s: Along x of the base, m/s.
        turn_rad_s: About z of the base, rad/s.
        time_ns: Stamp, ns.
    """
    result = Odometry(header=header(time_ns, ODOM), child_frame_id=BASE)
    result.pose.pose = pose_message(pose)
    result.twist.twist.linear.x = speed_m_s
    result.twist.twist.angular.z = turn_rad_s
    return result


def planar_pose(pose: Any) -> PlanarPose:
    """Return position and heading of a Pose.

    Args:
        pose: Its roll and pitch are ignored.

    Raises:
        ValueError: The position is not within `MAX_GOAL_M`, or the quaternion has not length 1.
    """
    position, turn = pose.position, pose.orientation
    length = math.hypot(turn.x, turn.y, turn.z, turn.w)
    if not (math.hypot(position.x, position.y) <= MAX_GOAL_M and abs(length - 1) < 0.01):
        numbers = position.x, position.y, turn.x, turn.y, turn.z, turn.w
        raise ValueError(f"x, y and quaternion x, y, z, w are no pose in a home: {numbers}")
    sine, cosine = turn.w * turn.z + turn.x * turn.y, turn.y * turn.y + turn.z * turn.z
    return PlanarPose(position.x, position.y, math.atan2(2 * sine, length * length - 2 * cosine))
