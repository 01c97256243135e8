"""The simulated robot on foot: it cannot jump over what stands in its way."""

from __future__ import annotations

import numpy as np

from gslts.core.frame import RgbdFrame
from gslts.types import Floats
from gslts_bench.navigation.truth import Truth
from gslts_sim.controller import Controller
from gslts_sim.event import Event


class Walker:
    """A robot that goes straight from place to place, or not at all; satisfies `Robot`.

    Args:
        controller: The robot, which teleports.
        truth: Of the home.

    Attributes:
        places: Where it was in truth, each (2,) x and y, m.
    """

    def __init__(self, controller: Controller, truth: Truth) -> None:
        self._controller, self._truth = controller, truth
        self._reachable = controller.reachable_positions()
        self._event = controller.step("Pass")
        self.places: list[Floats] = [self._here()]

    @property
    def event(self) -> Event:
        """Of its last look."""
        return self._event

    @property
    def length_m(self) -> float:
        """Of its way in truth."""
        steps = np.diff(np.array(self.places), axis=0)
        return float(np.linalg.norm(steps, axis=1).sum())

    def observe(self) -> RgbdFrame:
        """What the camera sees now."""
        self._event = self._controller.step("Pass")
        return self._event.observation

    def pose(self) -> Floats:
        """Return [4,4] world_from_camera that the robot believes, m."""
        return self._controller.pose()

    def reachable_positions(self) -> Floats:
        """[P,2] places on its grid, x and y, m."""
        return self._reachable

    def move_towards(
        self, position: Floats, yaw_rad: float, pitch_rad: float | None = None
    ) -> bool:
        """Goes straight to the reachable place nearest to `position`, if nothing is between."""
        metres = np.linalg.norm(self._reachable - position, axis=1)
        place = self._reachable[np.argmin(metres)]
        if not self._truth.is_straight(self.places[-1], place):
            return False
        arrived = self._controller.move_towards(place, yaw_rad, pitch_rad)
        if arrived and np.linalg.norm(place - self.places[-1]) > 0:
            self.places.append(place)
        return arrived

    def _here(self) -> Floats:
        position = self._event.metadata["agent"]["position"]
        return np.array([position["x"], position["y"]])
