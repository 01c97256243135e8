"""Errands that a robot runs while its map is watched, and repaired on the way."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from gslts.core.frame import RgbdFrame
from gslts.core.robot import Robot
from gslts.keeper.keeper import MapKeeper
from gslts.navigation.navigator import Navigator
from gslts.navigation.trip import NavigationResult
from gslts.semantics.map_semantics import MapSemantics

MOST_TRIES = 3


class WatchedRobot:
    """A robot on an errand, itself a `Robot`: what it sees is watched for changes.

    Before it moves on, what is certain to have changed is repaired, for which it leaves its way.

    Args:
        robot: In the home of the map.
        keeper: Of the map.
    """

    def __init__(self, robot: Robot, keeper: MapKeeper) -> None:
        self._robot, self._keeper = robot, keeper

    def observe(self) -> RgbdFrame:
        """What the camera sees now, which the keeper sees too."""
        frame = self._robot.observe()
        self._keeper.watch(frame)
        return frame

    def pose(self) -> NDArray[np.float64]:
        """Return [4,4] world_from_camera that the robot believes, m."""
        return self._robot.pose()

    def reachable_positions(self) -> NDArray[np.float64]:
        """[P,2] as those of the robot."""
        return self._robot.reachable_positions()

    def move_towards(
        self, position: NDArray[np.float64], yaw_rad: float, pitch_rad: float | None = None
    ) -> bool:
        """As `Robot.move_towards`, once what has changed is repaired."""
        self._keeper.attend(self._robot)
        return self._robot.move_towards(position, yaw_rad, pitch_rad)


def run_errand(
    keeper: MapKeeper,
    semantics: MapSemantics,
    robot: Robot,
    text: str,
    tell: Callable[[], None] = lambda: None,
) -> tuple[Navigator, NavigationResult]:
    """Lets a robot go to the nearest thing that fits a text, and keep the map up to date meanwhile.

    Where it did not get there and the map is another one by now, it tries again with that: what it
    came for may have moved.

    Args:
        keeper: Of the map.
        semantics: Of the map.
        robot: In the home.
        text: Such as "sofa".
        tell: Is told of each move.

    Returns:
        What led the robot at last, and how that went.

    Raises:
        StoppedError: As the keeper was wished to.
        OSError: The map cannot be written.
        ValueError: The text is empty.
    """
    watched = WatchedRobot(robot, keeper)
    for _ in range(MOST_TRIES):
        version = keeper.version.number
        navigator = Navigator(
            keeper.gaussian_map, semantics.autoencoder, semantics.source, categories=[text]
        )
        journey = navigator.go(watched, text, tell)
        keeper.attend(robot)
        if journey.status == "reached" or keeper.version.number == version:
            break
    return navigator, journey
