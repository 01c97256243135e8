"""Object navigation while the keeper watches for changes and updates the map."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from gslts.core.frame import RgbdFrame
from gslts.core.robot import Robot
from gslts.core.robot_body import RobotBody
from gslts.keeper.keeper import MapKeeper
from gslts.navigation.navigator import Navigator
from gslts.navigation.semantic_map import make_semantic_map
from gslts.navigation.terrain import Terrain
from gslts.navigation.trip import NavigationResult, Trip
from gslts.navigation.viewpoints import Target
from gslts.semantics.map_semantics import MapSemantics
from gslts.store.causes import Box
from gslts.types import Floats

Planned = TypeVar("Planned")

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
    body: RobotBody | None = None,
) -> tuple[Navigator, NavigationResult]:
    """Move a robot to the nearest object that fits a text, and update the map on the way.

    If the robot does not reach it and the map was updated meanwhile, a new path is planned.

    Args:
        keeper: Of the map.
        semantics: Of the map.
        robot: In the home.
        text: Query such as "sofa".
        on_move: Called after each move.
        body: Size of the robot; None for the default.

    Returns:
        The last navigator and its result.

    Raises:
        StoppedError: A stop was requested.
        OSError: The map cannot be written.
        ValueError: The text is empty.
    """
    watched = WatchedRobot(robot, keeper)

    def attempt() -> tuple[Navigator, NavigationResult]:
        navigator = Navigator(
            keeper.gaussian_map,
            semantics.codec,
            semantics.source,
            categories=[text],
            body=body,
        )
        return navigator, navigator.go(watched, text, on_move)

    return _until_settled(keeper, robot, attempt)


def go_to_box(
    keeper: MapKeeper, robot: Robot, name: str, box: Box, body: RobotBody | None = None
) -> NavigationResult:
    """Move a robot to what the map shows in a box, and update the map on the way.

    Args:
        keeper: Of the map, which needs no semantics.
        robot: In the home.
        name: Of the object.
        box: Lower and upper corner in the world, m.
        body: Size of the robot; None for the default.

    Returns:
        The result.

    Raises:
        StoppedError: A stop was requested.
        OSError: The map cannot be written.
        ValueError: The map shows nothing in the box, or no floor.
    """
    watched, body = WatchedRobot(robot, keeper), body or RobotBody()

    def attempt() -> tuple[Target, NavigationResult]:
        gaussian_map = keeper.gaussian_map
        terrain = Terrain(make_semantic_map(gaussian_map, body), body)
        target = Target.in_box(gaussian_map, box)
        trip = Trip(watched, name, gaussian_map, terrain, None, lambda: None)
        return target, trip.go_to_any([target])

    return _until_settled(keeper, robot, attempt)[1]


def drive_to(
    keeper: MapKeeper,
    robot: Robot,
    words: str,
    box: Box | None = None,
    body: RobotBody | None = None,
) -> NavigationResult:
    """Move a robot to what somebody asks for, and update the map on the way.

    Args:
        keeper: Of the map.
        robot: In the home.
        words: Query that finds the object, or its name.
        box: Lower and upper corner of the object in the world, m; None if it should be found.
        body: Size of the robot; None for the default.

    Returns:
        The result.

    Raises:
        StoppedError: A stop was requested.
        OSError: The map cannot be written.
        ValueError: The map has no semantics, the text is empty, or the box is.
    """
    if box is not None:
        return go_to_box(keeper, robot, words, box, body)
    if keeper.semantics is None:
        raise ValueError("the map has no words; gslts semantics adds them")
    return run_errand(keeper, keeper.semantics, robot, words, body=body)[1]


def _until_settled(
    keeper: MapKeeper, robot: Robot, attempt: Callable[[], tuple[Planned, NavigationResult]]
) -> tuple[Planned, NavigationResult]:
    """Attempt a trip again while it fails and the map was updated meanwhile.

    A robot that has reached the object stays there: `keeper.reports` returns later what the last
    frames confirmed, as it would drive away for views of that.
    """
    for _ in range(MAX_ATTEMPTS):
        version = keeper.version.number
        planned, result = attempt()
        if result.status == "reached":
            break
        keeper.integrate(robot, keeper.reports())
        if keeper.version.number == version:
            break
    return planned, result
