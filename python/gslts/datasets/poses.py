"""Poses as files store them: quaternion and translation, and interpolation in time."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from gslts.core.se3 import rotation, rotation_of_quat, rotation_vector
from gslts.types import Floats

OPENGL_FROM_OPENCV = np.diag([1.0, -1.0, -1.0, 1.0])
"""[4,4] change of camera axes: y and z point the other way."""
LENGTH_TOLERANCE = 0.01
"""Maximum error of the length of a unit quaternion, as files write few digits."""


def pose_from_quat(wxyz: ArrayLike, translation: ArrayLike) -> Floats:
    """Return the rigid transform of a quaternion and a translation.

    Args:
        wxyz: (4,) unit quaternion.
        translation: (3,), m.

    Returns:
        [4,4] rigid transform.

    Raises:
        ValueError: The quaternion does not have length 1, or a number is not finite.
    """
    length = math.hypot(*np.asarray(wxyz, np.float64).tolist())
    if not abs(length - 1) <= LENGTH_TOLERANCE:
        raise ValueError(f"the quaternion has length {length:.3f}, expected 1")
    if not np.isfinite(np.asarray(translation, np.float64)).all():
        raise ValueError(f"the position is not finite: {np.asarray(translation).tolist()}")
    pose = np.eye(4)
    pose[:3, :3] = rotation_of_quat(np.asarray(wxyz, np.float64))
    pose[:3, 3] = translation
    return pose


def pose_from_numbers(numbers: Floats) -> Floats:
    """Return the rigid transform of a row of numbers, as trajectories store it.

    Args:
        numbers: (7,) x y z, m, and the quaternion x y z w.

    Returns:
        [4,4] rigid transform.

    Raises:
        ValueError: See `pose_from_quat`.
    """
    x, y, z, w = numbers[3:]
    return pose_from_quat((w, x, y, z), numbers[:3])


def inverse(pose: Floats) -> Floats:
    """Return the inverse of a rigid transform.

    Args:
        pose: [4,4] b_from_a.

    Returns:
        [4,4] a_from_b.
    """
    result = np.eye(4)
    result[:3, :3] = pose[:3, :3].T
    result[:3, 3] = -pose[:3, :3].T @ pose[:3, 3]
    return result


def interpolate_pose(first: Floats, second: Floats, share: float) -> Floats:
    """Interpolate between two poses: translation linearly, rotation at constant angular velocity.

    Args:
        first: [4,4] pose at share 0.
        second: [4,4] pose at share 1; rotated from the first by well below 180 degrees.
        share: 0 to 1.

    Returns:
        [4,4] rigid transform.
    """
    pose = np.eye(4)
    turn = rotation_vector(first[:3, :3].T @ second[:3, :3])
    pose[:3, :3] = first[:3, :3] @ rotation(share * turn)
    pose[:3, 3] = (1 - share) * first[:3, 3] + share * second[:3, 3]
    return pose
