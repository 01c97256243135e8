"""Odometry of wheels, which drifts.

Source: the noise of motions of Thrun, Burgard and Fox, Probabilistic Robotics (2005), sec. 5.4.
"""

from __future__ import annotations

import math

import numpy as np

from gslts_sim.ros.planar_pose import PlanarPose

SCALE_STD = 0.01
"""Standard deviation of the relative errors of distances and of turns that a robot keeps: radius
and distance of the wheels, calibrated to 1 %."""
DISTANCE_STD = 0.01
"""Standard deviation of the measured distance after 1 m, m; grows with the square root: slip."""
YAW_STD_RAD = math.radians(0.5)
"""Standard deviation of the measured yaw after 1 m, rad; grows with the square root: slip."""


class Odometry:
    """Pose of a robot by its own odometry, from where it started.

    Args:
        seed: Same seed and same motions, same drift.
        drift: Factor of all errors; 0 for perfect odometry.
    """

    def __init__(self, seed: int, drift: float = 1.0) -> None:
        self._rng = np.random.default_rng([seed, 4])
        self._drift = drift
        distance, turn = self._rng.normal(size=2)
        self._distance_scale = 1 + drift * SCALE_STD * float(distance)
        self._turn_scale = 1 + drift * SCALE_STD * float(turn)
        self.pose = PlanarPose(0.0, 0.0, 0.0)

    def add(self, turn_rad: float, forward_m: float) -> None:
        """Add a motion as the wheels measure it.

        Args:
            turn_rad: True turn in place, rad.
            forward_m: True straight motion after it, m, not negative.
        """
        spread = self._drift * math.sqrt(forward_m)
        distance, yaw = self._rng.normal(size=2)
        self.pose = self.pose.moved(
            self._turn_scale * turn_rad + spread * YAW_STD_RAD * float(yaw),
            self._distance_scale * forward_m + spread * DISTANCE_STD * float(distance),
        )
