"""Poses as files write them: quaternions, and moments between two of them."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from gslts.core.se3 import rotation, rotation_of_quat, rotation_vector
from gslts.types import Floats

LENGTH_TOLERANCE = 0.01
"""Of the length of a quaternion, which is written with some digits only."""


def pose_of(wxyz: ArrayLike, translation: ArrayLike) -> Floats:
    """[4,4] rigid transform of a quaternion and a translation, m.

    Raises:
        ValueError: The quaternion has not the length 1, or a number is not finite.
    """
    length = math.hypot(*np.asarray(wxyz, np.float64).tolist())
    if not abs(length - 1) <= LENGTH_TOLERANCE:
        raise ValueError(f"its quaternion has the length {length:.3f}")
    if not np.isfinite(np.asarray(translation, np.float64)).all():
        raise ValueError(f"its place is {np.asarray(translation).tolist()}")
    pose = np.eye(4)
    pose[:3, :3] = rotation_of_quat(np.asarray(wxyz, np.float64))
    pose[:3, 3] = translation
    return pose


def inverse(pose: Floats) -> Floats:
    """[4,4] of a rigid transform."""
    result = np.eye(4)
    result[:3, :3] = pose[:3, :3].T
    result[:3, 3] = -pose[:3, :3].T @ pose[:3, 3]
    return result


def between(first: Floats, second: Floats, share: float) -> Floats:
    """[4,4] the pose after a share of the way from one to another, turning evenly.

    Args:
        first: [4,4], at share 0.
        second: [4,4], at share 1; turned from the first by well below 180 degrees.
        share: From 0 to 1.
    """
    pose = np.eye(4)
    turn = rotation_vector(first[:3, :3].T @ second[:3, :3])
    pose[:3, :3] = first[:3, :3] @ rotation(share * turn)
    pose[:3, 3] = (1 - share) * first[:3, 3] + share * second[:3, 3]
    return pose
