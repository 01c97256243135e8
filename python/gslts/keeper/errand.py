"""Object navigation while the keeper watches for changes and updates the map."""

from __future__ import annotations

from collections.abc import Callable

from gslts.core.frame import RgbdFrame
from gslts.core.robot import Robot
from gslts.keeper.keeper import MapKeeper
from gslts.navigation.navigator import Navigator
from gslts.navigation.trip import NavigationResult
from gslts.semantics.map_semantics import MapSemantics
from gslts.types import Floats

MAX_ATTEMPTS = 3
"""Maximum number of paths planned for one errand: the object may have been moved."""


class WatchedRobot:
    """A `Robot` whose frames are watched for changes.

    Before it moves on, confirmed changes are integrated into the map, for which it leaves its path.

    Args:
        robot: In the home of the map.
        keeper: Of the map.
    """

    def __init__(self, robot: Robot, keeper: MapKeeper) -> None:
        self._robot, self._keeper = robot, keeper

    def observe(self) -> RgbdFrame:
        """Take a frame, and pass it to the keeper."""
        frame = self._robot.observe()
        self._keeper.watch(frame)
        return frame

    def pose(self) -> Floats:
        """Return [4,4] world_from_camera that the robot believes, m."""
        return self._robot.pose()

    def reachable_positions(self) -> Floats:
        """Return [P,2] positions that the robot can reach, x and y in the world, m."""
        return self._robot.reachable_positions()

    def move_towards(
        self, position: Floats, yaw_rad: float, pitch_rad: float | None = None
    ) -> bool:
        """Integrate confirmed changes, then move as `Robot.move_towards`.

        Args:
            position: (2,) x and y in the world, m.
            yaw_rad: Final direction of the camera about the z axis, rad.
            pitch_rad: Final angle of the camera below the horizon, rad; None keeps the current one.

        Returns:
            True if the robot arrived.
        """
        self._keeper.integrate(self._robot, self._keeper.reports())
        return self._robot.move_towards(position, yaw_rad, pitch_rad)


def run_errand(
    keeper: MapKeeper,
    semantics: MapSemantics,
    robot: Robot,
    text: str,
    on_move: Callable[[], None] = lambda: None,
) -> tuple[Navigator, NavigationResult]:
    """Move a robot to the nearest object that fits a text, and update the map on the way.

    If the robot does not reach it and the map was updated meanwhile, a new path is planned.

    Args:
        keeper: Of the map.
        semantics: Of the map.
        robot: In the home.
        text: Query such as "sofa".
        on_move: Called after each move.

    Returns:
        The last navigator and its result.

    Raises:
        StoppedError: A stop was requested.
        OSError: The map cannot be written.
        ValueError: The text is empty.
    """
    watched = WatchedRobot(robot, keeper)
    for _ in range(MAX_ATTEMPTS):
        version = keeper.version.number
        navigator = Navigator(
            keeper.gaussian_map, semantics.codec, semantics.source, categories=[text]
        )
        result = navigator.go(watched, text, on_move)
        keeper.integrate(robot, keeper.reports())
        if result.status == "reached" or keeper.version.number == version:
            break
    return navigator, result
