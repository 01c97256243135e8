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
        turned_rad = float(abs(self._turned_rad[b] - self._turned_rad[a]))
        return may_drift(self.motion(a, b), a_from_b, self.path_m(a, b), turned_rad)


def may_drift(given: Floats, found: Floats, path_m: float, turned_rad: float) -> bool:
    """Test if two motions differ by no more than an odometry drifts on its path.

    Args:
        given: [4,4] motion by the odometry, m.
        found: [4,4] the same motion by other means, m.
        path_m: Length of the path, m.
        turned_rad: Sum of all turns on it, rad.
    """
    metres, turn_rad = pose_distance(given, found)
    of_turns_rad = MAX_DRIFT_OF_TURNS * turned_rad
    return bool(
        metres <= MAX_DRIFT_M + (MAX_DRIFT_SHARE + of_turns_rad) * path_m
        and turn_rad <= MAX_DRIFT_RAD + MAX_DRIFT_RAD_PER_M * path_m + of_turns_rad
    )
