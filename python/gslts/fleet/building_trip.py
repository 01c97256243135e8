"""Trips of a robot through the rooms of a building, each by its own map."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gslts.core.robot import Robot
from gslts.core.se3 import relative
from gslts.fleet.building import Building
from gslts.fleet.building_query import BuildingAnswer
from gslts.fleet.building_route import Leg, RoomFloor, Route, RoutePlanner
from gslts.navigation.navigator import Navigator
from gslts.navigation.planner import PlannedPath
from gslts.navigation.trip import Status
from gslts.navigation.walk import Walk
from gslts.robots.in_frame import RobotInFrame


@dataclass(frozen=True)
class BuildingTripResult:
    """Result of a trip to an object.

    Attributes:
        status: "reached", or the kind of failure.
        reason: Reason of the failure; empty if the object was reached.
        length_m: Length of the path, m.
        distance_m: Distance along the floor from the last position to the object, m; None if it was
            not reached.
    """

    status: Status
    reason: str
    length_m: float
    distance_m: float | None = None


def go_through_building(
    building: Building,
    answer: BuildingAnswer,
    robot: Robot,
    text_model: Path | None = None,
    on_route: Callable[[Route], None] = lambda _: None,
    on_move: Callable[[], None] = lambda: None,
) -> BuildingTripResult:
    """Move a robot to the nearest object that a query found, and look at it.

    A door that cannot be passed, or a room where the object is not found, leads to another route.

    Args:
        building: The building.
        answer: Of a query.
        robot: Its frame is that of the building.
        text_model: Folder of a text model; see `open_text_source`.
        on_route: Called with each route before the robot takes it.
        on_move: Called after each move.

    Returns:
        The result; expected failures have a status and a reason there.

    Raises:
        OSError: A map cannot be read.
        ValueError: A map is damaged.
    """
    planner = RoutePlanner(building, answer)
    rooms, length_m = planner.rooms_at(robot.pose()[:3, 3]), 0.0
    status: Status = "unreachable" if answer.found else "not found"
    reason = ""
    while True:
        route = planner.plan(robot.pose()[:3, 3], rooms)
        if route.reason:
            return BuildingTripResult(status, reason or route.reason, length_m)
        on_route(route)
        for leg in route.legs[:-1]:
            reason, passed_m = _pass(leg, planner.floor(leg.room), robot, on_move)
            length_m += passed_m
            if reason:
                break
        else:
            leg = route.legs[-1]
            navigator = Navigator.of_map(building.map_path(leg.room), text_model=text_model)
            result = navigator.go(_in_map(robot, planner.floor(leg.room)), answer.text, on_move)
            length_m += result.length_m
            if result.status == "reached":
                return BuildingTripResult("reached", "", length_m, result.distance_m)
            status, reason = result.status, f"{leg.room}: {result.reason}"
        planner.exclude(leg.end)
        rooms = [leg.room]


def _pass(
    leg: Leg, floor: RoomFloor, robot: Robot, on_move: Callable[[], None]
) -> tuple[str, float]:
    """Move to the door at the end of a leg; return why the robot did not arrive, and metres."""
    walk = Walk(_in_map(robot, floor), floor.terrain, on_move)
    reason = walk.go_near(floor.to_map(leg.path[-1]))
    reason = reason and f"{leg.room}, to the {leg.end}: {reason}"
    return reason, PlannedPath(np.array(walk.path)).length_m


def _in_map(robot: Robot, floor: RoomFloor) -> Robot:
    """Return a robot in the frame of the map of a room."""
    if (floor.building_from_map == np.eye(4)).all():
        return robot
    return RobotInFrame(robot, relative(floor.building_from_map, np.eye(4)))
