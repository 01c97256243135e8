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
    header: Header,
    world_from_camera: Floats,
    covariance: Floats,
    camera_from_body: Floats | None = None,
) -> PoseWithCovarianceStamped:
    """Return a localized pose, with its covariance in the order and the frame of ROS.

    Args:
        header: Its frame is the world.
        world_from_camera: [4,4] rigid, m.
        covariance: [6,6] of a twist (rho, phi) of world_from_camera @ exp(rho, phi), m and rad, as
            of `gslts.localization.relocalizer.Localization`.
        camera_from_body: [4,4] pose of the body in the camera, rigid, m, for the pose of the base
            of the robot; None for that of the camera.
    """
    mount = np.eye(4) if camera_from_body is None else camera_from_body
    message = PoseWithCovarianceStamped(header=header)
    message.pose.pose = pose_message(product(world_from_camera, mount))
    turned = covariance_in_world(world_from_camera[:3, :3], covariance, mount[:3, 3])
    message.pose.covariance = turned.ravel()
    return message


def covariance_in_world(turn: Floats, covariance: Floats, lever_m: Floats) -> Floats:
    """Convert the covariance of a twist of the camera to that of a pose in ROS.

    Args:
        turn: [3,3] rotation of world_from_camera.
        covariance: [6,6] of a twist (rho, phi) in the camera, m and rad.
        lever_m: (3,) origin of the body in the camera, m.

    Returns:
        [6,6] of x, y, z of the body and of rotations about the fixed axes x, y, z of the world, m
        and rad.

    Source: `geometry_msgs/PoseWithCovariance`; the adjoint of SE(3), Sola et al. 2018, "A micro Lie
    theory for state estimation in robotics".
    """
    x, y, z = lever_m
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    jacobian = np.zeros((6, 6))
    jacobian[:3, :3] = jacobian[3:, 3:] = turn
    jacobian[:3, 3:] = -product(turn, cross)  # phi x lever = -lever x phi.
    result = product(product(jacobian, covariance), jacobian.T)
    symmetric: Floats = (result + result.T) / 2
    return symmetric


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
