"""Simulated robot that cannot pass through obstacles."""

from __future__ import annotations

import numpy as np

from gslts.core.frame import RgbdFrame
from gslts.types import Floats
from gslts_bench.navigation.truth import Truth
from gslts_sim.controller import Controller
from gslts_sim.event import Event


class Walker:
    """A robot that moves along free straight lines only; satisfies `Robot`.

    Args:
        controller: The robot, which teleports.
        truth: Ground truth of the home.

    Attributes:
        positions: True positions so far, each (2,) x and y, m.
    """

    def __init__(self, controller: Controller, truth: Truth) -> None:
        self._controller, self._truth = controller, truth
        self._reachable = controller.reachable_positions()
        self._event = controller.step("Pass")
        self.positions: list[Floats] = [self._here()]

    @property
    def event(self) -> Event:
        """Event of the last observation."""
        return self._event

    @property
    def length_m(self) -> float:
        """Length of the true path."""
        steps = np.diff(np.array(self.positions), axis=0)
        return float(np.linalg.norm(steps, axis=1).sum())

    def observe(self) -> RgbdFrame:
        """Return the frame of the camera now."""
        self._event = self._controller.step("Pass")
        return self._event.observation

    def pose(self) -> Floats:
        """Return [4,4] world_from_camera that the robot believes, m."""
        return self._controller.pose()

    def reachable_positions(self) -> Floats:
        """Return the positions [P,2] on its grid, x and y, m."""
        return self._reachable

    def move_towards(
        self, position: Floats, yaw_rad: float, pitch_rad: float | None = None
    ) -> bool:
        """Move straight to the reachable position nearest to a position, if the line is free.

        Args:
            position: (2,) x and y, m.
            yaw_rad: Direction of the camera afterwards.
            pitch_rad: Pitch of the camera afterwards; None keeps it.

        Returns:
            Whether the robot arrived.
        """
        metres = np.linalg.norm(self._reachable - position, axis=1)
        target = self._reachable[np.argmin(metres)]
        if not self._truth.is_straight(self.positions[-1], target):
            return False
        arrived = self._controller.move_towards(target, yaw_rad, pitch_rad)
        if arrived and np.linalg.norm(target - self.positions[-1]) > 0:
            self.positions.append(target)
        return arrived

    def _here(self) -> Floats:
        position = self._event.metadata["agent"]["position"]
        return np.array([position["x"], position["y"]])
