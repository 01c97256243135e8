"""Drift of an odometry: motions that it allows for."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from gslts.core.se3 import pose_distance, relative
from gslts.trajectory.constants import (
    MAX_DRIFT_M,
    MAX_DRIFT_OF_TURNS,
    MAX_DRIFT_RAD,
    MAX_DRIFT_RAD_PER_M,
    MAX_DRIFT_SHARE,
)
from gslts.types import Floats


class DriftingPoses:
    """Poses of a recording by an odometry, whose error grows along the path and with its turns.

    Args:
        poses: World_from_camera [4,4] of each frame, m, in the order of the recording.
    """

    def __init__(self, poses: Sequence[Floats]) -> None:
        self._poses = poses
        steps = [pose_distance(before, after) for before, after in pairwise(poses)]
        self._path_m, self._turned_rad = np.cumsum([(0.0, 0.0), *steps], axis=0).T

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
        of_turns_rad = MAX_DRIFT_OF_TURNS * abs(self._turned_rad[b] - self._turned_rad[a])
        return bool(
            metres <= MAX_DRIFT_M + (MAX_DRIFT_SHARE + of_turns_rad) * path_m
            and turn_rad <= MAX_DRIFT_RAD + MAX_DRIFT_RAD_PER_M * path_m + of_turns_rad
        )
