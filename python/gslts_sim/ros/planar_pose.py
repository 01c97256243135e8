"""Poses on the floor."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from gslts.types import Floats


class PlanarPose(NamedTuple):
    """Position and heading on the floor, in a frame with z up.

    Attributes:
        x: m.
        y: m.
        yaw_rad: About z, from x to y, rad; not wrapped.
    """

    x: float
    y: float
    yaw_rad: float

    @property
    def position(self) -> Floats:
        """(2,) x and y, m."""
        return np.array([self.x, self.y])

    def moved(self, turn_rad: float, forward_m: float) -> PlanarPose:
        """Return the pose after a turn in place and a straight motion.

        Args:
            turn_rad: Added to the yaw, rad.
            forward_m: Along the new heading, m.
        """
        yaw_rad = self.yaw_rad + turn_rad
        x, y = forward_m * math.cos(yaw_rad), forward_m * math.sin(yaw_rad)
        return PlanarPose(self.x + x, self.y + y, yaw_rad)

    def carried(self, source: PlanarPose, target: PlanarPose) -> PlanarPose:
        """Return the pose that stands to `target` as this pose stands to `source`.

        Args:
            source: In the frame of this pose, such as the robot as odometry knows it.
            target: In the frame of the result, such as the same robot in the world.
        """
        turn_rad = target.yaw_rad - source.yaw_rad
        cosine, sine = math.cos(turn_rad), math.sin(turn_rad)
        x, y = self.x - source.x, self.y - source.y
        return PlanarPose(
            target.x + cosine * x - sine * y,
            target.y + sine * x + cosine * y,
            self.yaw_rad + turn_rad,
        )

    def matrix(self, height_m: float = 0.0) -> Floats:
        """Return the pose as [4,4] rigid transform.

        Args:
            height_m: Of the floor, m.
        """
        cosine, sine = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return np.array(
            [
                [cosine, -sine, 0, self.x],
                [sine, cosine, 0, self.y],
                [0, 0, 1, height_m],
                [0, 0, 0, 1.0],
            ]
        )


def wrap_angle(angle_rad: float) -> float:
    """Return an angle in -pi..pi.

    Args:
        angle_rad: Any angle, rad.
    """
    return math.remainder(angle_rad, math.tau)
