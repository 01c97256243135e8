"""Poses and transforms as messages."""

from __future__ import annotations

import numpy as np
from geometry_msgs.msg import Pose, PoseWithCovarianceStamped, Transform, TransformStamped
from std_msgs.msg import Header

from gslts.core.se3 import product, quats_of_rotations
from gslts.types import Floats


def pose_message(frame_from_body: Floats) -> Pose:
    """Return a pose.

    Args:
        frame_from_body: [4,4] rigid, m.
    """
    pose = Pose()
    _set_point(pose.position, frame_from_body)
    _set_quaternion(pose.orientation, frame_from_body)
    return pose


def localized_pose_message(
    header: Header, world_from_camera: Floats, covariance: Floats
) -> PoseWithCovarianceStamped:
    """Return a localized pose, with its covariance in the order and the frame of ROS.

    Args:
        header: Its frame is the world.
        world_from_camera: [4,4] rigid, m.
        covariance: [6,6] of a twist (rho, phi) of world_from_camera @ exp(rho, phi), m and rad, as
            of `gslts.localization.relocalizer.Localization`.

    Source: `geometry_msgs/PoseWithCovariance`: rotations about the fixed axes of the world.
    """
    message = PoseWithCovarianceStamped(header=header)
    message.pose.pose = pose_message(world_from_camera)
    world_from_twist = np.zeros((6, 6))
    world_from_twist[:3, :3] = world_from_twist[3:, 3:] = world_from_camera[:3, :3]
    in_world = product(product(world_from_twist, covariance), world_from_twist.T)
    message.pose.covariance = in_world.ravel()
    return message


def transform_message(
    header: Header, child_frame_id: str, parent_from_child: Floats
) -> TransformStamped:
    """Return a transform for tf, such as from `odom` to `map`.

    Args:
        header: Its frame is the parent.
        child_frame_id: Name of the child frame.
        parent_from_child: [4,4] rigid, m.
    """
    transform = Transform()
    _set_point(transform.translation, parent_from_child)
    _set_quaternion(transform.rotation, parent_from_child)
    return TransformStamped(header=header, child_frame_id=child_frame_id, transform=transform)


def _set_point(field: object, pose: Floats) -> None:
    """Set x, y and z of a Point or a Vector3."""
    for name, value in zip("xyz", pose[:3, 3].tolist(), strict=True):
        setattr(field, name, value)


def _set_quaternion(field: object, pose: Floats) -> None:
    quat = quats_of_rotations(pose[None, :3, :3])[0]
    for name, value in zip("wxyz", quat.tolist(), strict=True):
        setattr(field, name, value)
