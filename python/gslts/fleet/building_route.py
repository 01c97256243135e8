"""Shortest routes through the doors of a building, on the grids of the maps of its rooms."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import count

import numpy as np

from gslts.core.robot_body import RobotBody
from gslts.core.se3 import inverse_transform, transform
from gslts.fleet.building import Building
from gslts.fleet.building_file import Door
from gslts.fleet.building_query import BuildingAnswer, FoundObject
from gslts.navigation.planner import MAX_START_OFFSET_M, PlannedPath
from gslts.navigation.semantic_map import make_semantic_map
from gslts.navigation.terrain import MAX_HEIGHT_M, MIN_HEIGHT_M, Terrain
from gslts.navigation.trip import GOAL_DISTANCE_M
from gslts.store.map_folder import read_map
from gslts.types import Floats

MAX_DOOR_OFFSET_M = MAX_START_OFFSET_M / 3
"""Maximum distance from a door to the free floor of both maps. From the free floor of one map, a
robot that stands a little beside it must find that of the other one within `MAX_START_OFFSET_M`."""
MAX_REASONS = 4
"""Maximum number of reasons that a message names: two lines of a terminal."""


@dataclass(frozen=True, eq=False)
class Leg:
    """Part of a route within a room.

    Attributes:
        room: Name of the room.
        path: [P,2] corners, x and y in the building frame, m.
        end: Door at its end, or the object.
    """

    room: str
    path: Floats
    end: Door | FoundObject

    @property
    def length_m(self) -> float:
        """Length, m."""
        return PlannedPath(self.path).length_m

    @property
    def next_room(self) -> str | None:
        """Name of the room behind the door; None at the end of a route."""
        if isinstance(self.end, FoundObject):
            return None
        first, second = self.end.rooms
        return second if self.room == first else first


@dataclass(frozen=True, eq=False)
class Route:
    """Route to an object, or the reason why there is none.

    Attributes:
        legs: From the start to the object; empty if there is no route.
        reason: Reason why there is no route; empty if there is one.
    """

    legs: tuple[Leg, ...]
    reason: str = ""

    @property
    def length_m(self) -> float:
        """Length, m."""
        return sum(leg.length_m for leg in self.legs)

    @property
    def found(self) -> FoundObject:
        """The object."""
        end = self.legs[-1].end
        assert isinstance(end, FoundObject)
        return end


class RoomFloor:
    """Free floor of the map of a room, in the building frame.

    Args:
        building: The building.
        room: Name of the room.
        body: Size of the robot.

    Attributes:
        building_from_map: [4,4] rigid, m.
        terrain: In the frame of the map; learns obstacles.

    Raises:
        OSError: The map cannot be read.
        ValueError: There is no such room, or its map is damaged or empty.
    """

    def __init__(self, building: Building, room: str, body: RobotBody) -> None:
        semantic_map = make_semantic_map(read_map(building.map_path(room)), body)
        self._room, self._floor_m = room, semantic_map.floor_m
        self.building_from_map = building.rooms[room].pose
        self.terrain = Terrain(semantic_map, body)
        self._height_m = float(self._lift(np.zeros((1, 2)))[0, 2])

    def to_map(self, position: Floats) -> Floats:
        """Return (2,) a position in the frame of the map, m.

        Args:
            position: (2,) or (3,) in the building frame, m.
        """
        on_floor = np.array([*position[:2], self._height_m])
        return inverse_transform(self.building_from_map, on_floor)[:2]

    def to_building(self, positions: Floats) -> Floats:
        """Return [P,2] positions in the building frame, m.

        Args:
            positions: [P,2] in the frame of the map, m.
        """
        return self._lift(positions)[:, :2]

    def is_known(self, position: Floats) -> bool:
        """Test if there is free floor below or near the position of a camera.

        Args:
            position: (3,) in the building frame, m.
        """
        return self.terrain.is_known(inverse_transform(self.building_from_map, position))

    def problem_of(self, door: Door) -> str:
        """Return why the map does not reach a door; empty if it does.

        Args:
            door: Of the room.
        """
        position = np.array(door.position_m)
        height_m = position[2] - self._height_m
        if not MIN_HEIGHT_M <= height_m <= MAX_HEIGHT_M:
            return f"the {door} is {height_m:.1f} m above the floor of {self._room}"
        free = self.to_building(self.terrain.free_positions())
        if len(free) == 0:
            return f"{self._room} has no free floor"
        distances_m = np.linalg.norm(free - position[:2], axis=1)
        nearest = int(np.argmin(distances_m))
        if distances_m[nearest] <= MAX_DOOR_OFFSET_M:
            return ""
        x, y = free[nearest].tolist()
        return (
            f"the {door} is {distances_m[nearest]:.2f} m from the free floor of {self._room}; its "
            f"nearest point is ({x:.2f}, {y:.2f}) m"
        )

    def _lift(self, positions: Floats) -> Floats:
        """Return [P,3] positions on the floor in the building frame."""
        heights = np.full((len(positions), 1), self._floor_m)
        return transform(self.building_from_map, np.hstack([positions, heights]))


class RoutePlanner:
    """Plans routes to the objects of an answer; reads the maps that they need.

    Args:
        building: The building.
        answer: Of a query.
        body: Size of the robot; None for the default.
    """

    def __init__(
        self, building: Building, answer: BuildingAnswer, body: RobotBody | None = None
    ) -> None:
        self._building, self._text = building, answer.text
        self._body = RobotBody() if body is None else body
        self._found: dict[str, list[FoundObject]] = {}
        for item in answer.found:
            self._found.setdefault(item.room, []).append(item)
        self._doors = list(building.doors)
        self._floors: dict[str, RoomFloor] = {}
        self._reasons: list[str] = []

    def floor(self, room: str) -> RoomFloor:
        """Return the floor of a room; it is read once.

        Args:
            room: Name of the room.

        Raises:
            OSError: The map cannot be read.
            ValueError: There is no such room, or its map is damaged or empty.
        """
        if room not in self._floors:
            self._floors[room] = RoomFloor(self._building, room, self._body)
        return self._floors[room]

    def rooms_at(self, position: Floats) -> list[str]:
        """Return the rooms whose maps have floor at a position.

        Args:
            position: (3,) of the camera of a robot, building frame, m.
        """
        known, _ = self._building.for_each_room(lambda room: self.floor(room).is_known(position))
        return [room for room, is_known in known.items() if is_known]

    def exclude(self, end: Door | FoundObject) -> None:
        """Plan no route any more through a door, or to the objects of a room.

        Args:
            end: The door, or an object in the room.
        """
        if isinstance(end, Door):
            self._doors.remove(end)
        else:
            del self._found[end.room]

    def plan(self, start: Floats, rooms: Iterable[str]) -> Route:
        """Plan the shortest route to the nearest object (Dijkstra 1959).

        Args:
            start: (2,) or (3,) in the building frame, m.
            rooms: Names of the rooms that the start may be in.

        Returns:
            The route, or the reason why there is none.
        """
        if not self._found:
            return Route((), f"the maps have no {self._text}")
        self._reasons = []
        number = count()
        done: set[tuple[str, float, float]] = set()
        queue: list[tuple[float, int, str | None, Floats, tuple[Leg, ...]]] = [
            (0.0, next(number), room, start[:2], ()) for room in rooms
        ]
        while queue:
            length_m, _, room, position, legs = heappop(queue)
            if room is None:
                return Route(legs)
            state = (room, float(position[0]), float(position[1]))
            if state in done:
                continue
            done.add(state)
            for leg in self._legs(room, position):
                entry = (length_m + leg.length_m, next(number), leg.next_room)
                heappush(queue, (*entry, leg.path[-1], (*legs, leg)))
        x, y = start[:2].tolist()
        reasons = list(dict.fromkeys(self._reasons)) or ["no map has floor there"]
        more = "; ..." if len(reasons) > MAX_REASONS else ""
        return Route(
            (),
            f"there is no route from ({x:.2f}, {y:.2f}) m to any {self._text}: "
            f"{'; '.join(reasons[:MAX_REASONS])}{more}",
        )

    def _legs(self, room: str, start: Floats) -> Iterator[Leg]:
        """Yield the shortest paths from a position to the doors and the objects of a room."""
        try:
            floor = self.floor(room)
        except (OSError, ValueError) as error:
            self._reasons.append(f"{room}: {error}")
            return
        terrain, at = floor.terrain, floor.to_map(start)
        for door in self._doors:
            if room not in door.rooms:
                continue
            problem = floor.problem_of(door)
            path = terrain.plan_near(at, floor.to_map(np.array(door.position_m)))
            if problem or path.reason:
                self._reasons.append(problem or f"{room}, to the {door}: {path.reason}")
                continue
            corners = floor.to_building(path.points)
            yield Leg(room, np.array([start, *corners[1:], door.position_m[:2]]), door)
        found = self._found.get(room, [])
        if not found:
            return
        free = terrain.free_positions()
        distances_m = [item.target.distances_m(free, GOAL_DISTANCE_M) for item in found]
        path = terrain.plan_to_any(at, free[np.min(distances_m, axis=0) <= GOAL_DISTANCE_M])
        if path.reason:
            self._reasons.append(f"{room}: {path.reason}")
            return
        nearest = np.argmin([item.target.distances_m(path.points[-1:])[0] for item in found])
        yield Leg(room, np.array([start, *floor.to_building(path.points)[1:]]), found[nearest])
