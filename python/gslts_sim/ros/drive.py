"""Motion of the robot along a path: turns in place, and straight lines."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from gslts.types import Floats
from gslts_sim.ros.planar_pose import PlanarPose, wrap_angle

SPEED_M_S = 0.5
"""Speed on straight lines, m/s: usual for service robots indoors."""
TURN_RAD_S = 1.0
"""Speed of turns in place, rad/s."""
TOLERANCE_M, TOLERANCE_RAD = 1e-3, 1e-6
"""Remaining distance and angle at which a corner is reached, m and rad."""

Motion = tuple[float, float]
"""A turn in place, rad, and a straight motion after it, m."""


class Drive:
    """Moves a robot through the corners of a path.

    Args:
        start: Pose of the robot in the world.

    Attributes:
        pose: Present pose in the world.
        corners: (2,) positions ahead, m.
        yaw_rad: Heading after the last corner, rad; None for any.
    """

    def __init__(self, start: PlanarPose) -> None:
        self.pose = start
        self.corners: list[Floats] = []
        self.yaw_rad: float | None = None

    @property
    def length_m(self) -> float:
        """Length of the path ahead, m."""
        points = [self.pose.position, *self.corners]
        return sum(float(np.linalg.norm(end - start)) for start, end in pairwise(points))

    def stop(self) -> None:
        """Stand still."""
        self.corners, self.yaw_rad = [], None

    def advance(self, duration_s: float) -> list[Motion]:
        """Move for some time.

        Args:
            duration_s: Time that passes, s.

        Returns:
            The motions that were made.
        """
        motions = []
        left_s = duration_s
        while left_s > 0 and (motion := self._next(left_s)) is not None:
            self.pose = self.pose.moved(*motion)
            left_s -= abs(motion[0]) / TURN_RAD_S + motion[1] / SPEED_M_S
            motions.append(motion)
        return motions

    def _next(self, left_s: float) -> Motion | None:
        while self.corners:
            x, y = (self.corners[0] - self.pose.position).tolist()
            distance_m = math.hypot(x, y)
            if distance_m > TOLERANCE_M:
                turn_rad = wrap_angle(math.atan2(y, x) - self.pose.yaw_rad)
                if abs(turn_rad) > TOLERANCE_RAD:
                    return self._turn(turn_rad, left_s)
                return 0.0, min(distance_m, SPEED_M_S * left_s)
            self.corners.pop(0)
        if self.yaw_rad is not None:
            turn_rad = wrap_angle(self.yaw_rad - self.pose.yaw_rad)
            if abs(turn_rad) > TOLERANCE_RAD:
                return self._turn(turn_rad, left_s)
            self.yaw_rad = None
        return None

    @staticmethod
    def _turn(turn_rad: float, left_s: float) -> Motion:
        return math.copysign(min(abs(turn_rad), TURN_RAD_S * left_s), turn_rad), 0.0
