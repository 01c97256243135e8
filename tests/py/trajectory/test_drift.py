"""Motions that the drift of an odometry allows for."""

import numpy as np
import pytest

from gslts.core.se3 import product
from gslts.datasets.poses import inverse
from gslts.trajectory.drift import DriftingPoses


def pose_of(x_m: float, y_m: float, yaw_rad: float) -> np.ndarray:
    cosine, sine = np.cos(yaw_rad), np.sin(yaw_rad)
    pose = np.eye(4)
    pose[:2] = [[cosine, -sine, 0, x_m], [sine, cosine, 0, y_m]]
    return pose


def poses_of_turns(turns: int, drift: float) -> list[np.ndarray]:
    """Return poses of a robot that turns around every metre, and drifts by a share of its turns."""
    poses, yaw_rad, place = [], 0.0, np.zeros(2)
    for _ in range(turns):
        for _ in range(24):
            poses.append(pose_of(*place, yaw_rad))
            yaw_rad += (1 + drift) * 2 * np.pi / 24
        place = place + np.array([np.cos(yaw_rad), np.sin(yaw_rad)])
    return poses


@pytest.mark.parametrize(("drift", "is_allowed"), [(0.02, True), (0.08, False)])
def test_an_odometry_drifts_by_a_share_of_its_turns(drift: float, is_allowed: bool) -> None:
    believed, true = poses_of_turns(6, drift), poses_of_turns(6, 0)
    motion = product(inverse(true[0]), true[-1])
    assert DriftingPoses(believed).allows(0, len(true) - 1, motion) == is_allowed


def test_an_odometry_that_hardly_turns_allows_for_little() -> None:
    poses = [pose_of(0.1 * step, 0, 0) for step in range(60)]
    drifting = DriftingPoses(poses)
    for off, is_allowed in (((0.3, 0, 0), True), ((0.6, 0, 0), False), ((0, 0, 0.5), False)):
        assert drifting.allows(0, 59, product(poses[59], pose_of(*off))) == is_allowed
