"""Poses as messages: quaternions, covariances in the frame of ROS, and transforms."""

from typing import Any

import numpy as np
import pytest

from gslts.core.se3 import rotation, rotation_of_quat, rotation_vector, se3_retract
from gslts.types import Floats

REASON = "needs the messages of ROS: scripts/setup ros"
poses = pytest.importorskip("gslts.ros.pose_message", reason=REASON)


def pose(turn_rad: tuple[float, float, float], position: tuple[float, float, float]) -> Floats:
    result = np.eye(4)
    result[:3, :3], result[:3, 3] = rotation(np.array(turn_rad)), position
    return result


CAMERA = pose((0.9, -1.4, 0.6), (2.0, -3.0, 1.2))


def covariance() -> Floats:
    """Return a covariance of millimetres and milliradians with all correlations."""
    factor = np.random.default_rng(0).normal(size=(6, 6)) * 1e-3
    result: Floats = factor @ factor.T
    return result


def matrix(position: Any, quaternion: Any) -> Floats:
    result = np.eye(4)
    result[:3, 3] = position.x, position.y, position.z
    wxyz = np.array([quaternion.w, quaternion.x, quaternion.y, quaternion.z])
    assert np.linalg.norm(wxyz) == pytest.approx(1)
    result[:3, :3] = rotation_of_quat(wxyz)
    return result


@pytest.mark.parametrize("turn", [(0, 0, 0), (np.pi, 0, 0), (0, np.pi, 0), (0, 0, -3.1), (1, 2, 0)])
def test_a_pose_comes_back(turn: tuple[float, float, float]) -> None:
    expected = pose(turn, (1, 2, 3))
    message = poses.pose_message(expected)
    np.testing.assert_allclose(matrix(message.position, message.orientation), expected, atol=1e-12)


def test_covariance_is_that_of_sampled_poses() -> None:
    own = covariance()
    message = poses.localized_pose_message(poses.Header(frame_id="map"), CAMERA, own)
    found = message.pose.pose
    assert message.header.frame_id == "map"
    np.testing.assert_allclose(matrix(found.position, found.orientation), CAMERA, atol=1e-12)
    twists = np.random.default_rng(1).multivariate_normal(np.zeros(6), own, 20_000)
    errors = []
    for twist in twists:
        sample = se3_retract(CAMERA, twist)
        turned = rotation_vector(sample[:3, :3] @ CAMERA[:3, :3].T)
        errors.append([*(sample[:3, 3] - CAMERA[:3, 3]), *turned])
    expected = np.cov(np.array(errors).T)
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    np.testing.assert_allclose(
        message.pose.covariance.reshape(6, 6) / scale, expected / scale, atol=0.03
    )


def test_a_transform_carries_its_frames() -> None:
    message = poses.transform_message(poses.Header(frame_id="map"), "odom", CAMERA)
    assert (message.header.frame_id, message.child_frame_id) == ("map", "odom")
    transform = message.transform
    np.testing.assert_allclose(
        matrix(transform.translation, transform.rotation), CAMERA, atol=1e-12
    )
