"""What the project asks of a robot, simulated or real."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gslts.core.frame import RgbdFrame


class Robot(Protocol):
    """A robot with an RGB-D camera on wheels."""

    def observe(self) -> RgbdFrame:
        """What the camera sees now, with the pose that the robot believes."""
        ...

    def reachable_positions(self) -> NDArray[np.float64]:
        """[P,2] places of the robot's middle on the floor, x and y in the world, m."""
        ...

    def move_towards(
        self, position: NDArray[np.float64], yaw_rad: float, pitch_rad: float | None = None
    ) -> bool:
        """Goes to the reachable position nearest to `position`, and turns.

        Args:
            position: (2,) x and y in the world, m.
            yaw_rad: Direction to look in then, from x to y, rad.
            pitch_rad: Angle of the camera below the horizon then, rad, as far as it can tilt; None
                leaves it as it is.

        Returns:
            Whether the robot arrived.
        """
        ...
