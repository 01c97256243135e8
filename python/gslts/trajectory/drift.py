"""Drift of an odometry: motions that it allows for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gslts.core.se3 import pose_distance, relative
from gslts.trajectory.constants import (
    MAX_DRIFT_M,
    MAX_DRIFT_RAD,
    MAX_DRIFT_RAD_PER_M,
    MAX_DRIFT_SHARE,
)
from gslts.types import Floats


class DriftingPoses:
    """Poses of a recording by an odometry, whose error grows along the path.

    Args:
        poses: World_from_camera [4,4] of each frame, m, in the order of the recording.
    """

    def __init__(self, poses: Sequence[Floats]) -> None:
        self._poses = poses
        centres = np.array([pose[:3, 3] for pose in poses]).reshape(-1, 3)
        steps_m = np.linalg.norm(np.diff(centres, axis=0), axis=1)
        self._path_m = np.concatenate([[0], np.cumsum(steps_m)])

    def motion(self, a: int, b: int) -> Floats:
        """Return the motion of the odometry between two frames, a_from_b [4,4].

        Args:
            a: Index of a frame.
            b: Index of another one.
        """
        return relative(self._poses[a], self._poses[b])

    def path_m(self, a: int, b: int) -> float:
        """Return the length of the path between two frames, m.

        Args:
            a: Index of a frame.
            b: Index of another one.
        """
        return float(abs(self._path_m[b] - self._path_m[a]))

    def allows(self, a: int, b: int, a_from_b: Floats) -> bool:
        """Test if a motion is that of the odometry, up to drift.

        Args:
            a: Index of a frame.
            b: Index of another one.
            a_from_b: [4,4] motion by other means, m.
        """
        metres, turn_rad = pose_distance(self.motion(a, b), a_from_b)
        path_m = self.path_m(a, b)
        return (
            metres <= MAX_DRIFT_M + MAX_DRIFT_SHARE * path_m
            and turn_rad <= MAX_DRIFT_RAD + MAX_DRIFT_RAD_PER_M * path_m
        )
