"""Where a robot can go, as its map tells and as it finds out on its way."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from gslts.core.frame import RgbdFrame
from gslts.core.robot_body import RobotBody
from gslts.navigation.local_obstacles import detect_obstacles
from gslts.navigation.planner import (
    PlannedPath,
    distance_field_m,
    free_cells,
    is_line_free,
    plan_path,
    start_cells,
)
from gslts.navigation.semantic_map import SemanticMap
from gslts.types import Floats

BLOCKED_M = 0.1
"""What is taken for blocked around where the robot did not get to."""
BESIDE = 2
"""So many cells beside the room that a map tells, a place counts as in it: obstacles are rough."""


class Terrain:
    """The floor of a home for one robot on one way.

    Args:
        semantic_map: Of the home.
        body: Of the robot.
    """

    def __init__(self, semantic_map: SemanticMap, body: RobotBody) -> None:
        self._map, self._body, self._grid = semantic_map, body, semantic_map.grid
        self._obstacles = semantic_map.obstacles.copy()
        self._blocked = np.zeros_like(self._obstacles)
        self._find_room()

    def metres(self, here: Floats, places: Floats) -> Floats:
        """[K] length of the way from (2,) to each of places [K,2]; infinite where there is none."""
        start = start_cells(self._grid, self._room, here)
        field = distance_field_m(self._room, start, self._grid.cell_m)
        around = self._grid.cells(places)[:, None] + _square(BESIDE)
        inside = self._grid.contains(around.reshape(-1, 2)).reshape(around.shape[:2])
        rows, columns = np.where(inside[..., None], around, 0).transpose(2, 0, 1)
        found = np.where(inside, field[rows, columns], np.inf).min(axis=1, initial=np.inf)
        near = np.linalg.norm(places - here, axis=1) <= BLOCKED_M
        metres: Floats = np.where(near, 0.0, found)
        return metres

    def is_known(self, here: Floats) -> bool:
        """Whether there is room for the robot at a place (2,) or near it."""
        return bool(start_cells(self._grid, self._room, here).any())

    def way(self, here: Floats, place: Floats) -> PlannedPath:
        """The shortest way from (2,) to (2,)."""
        if np.linalg.norm(place - here) <= BLOCKED_M:
            return PlannedPath(np.array([here, place]))
        goals = self._grid.mask(place[None])
        if not (goals & self._room).any():
            goals = self._beside(place)
        found = plan_path(self._grid, self._room, here, goals)
        return found if found.reason else PlannedPath(np.array([*found.points, place]))

    def is_free(self, way: Sequence[Floats]) -> bool:
        """Whether straight lines between some points (2,) lead through room."""
        return all(is_line_free(self._grid, self._room, start, end) for start, end in pairwise(way))

    def block(self, place: Floats, here: Floats) -> None:
        """Enters that a robot which is at (2,) cannot get to a place (2,)."""
        self._blocked |= self._within(place, BLOCKED_M) & ~self._within(here, self._grid.cell_m)
        self._find_room()

    def learns(self, frame: RgbdFrame) -> bool:
        """Enters obstacles that a frame shows; whether there are any that were not known."""
        fresh = detect_obstacles(frame, self._map, self._obstacles, self._body)
        if not fresh.any():
            return False
        self._obstacles |= fresh
        self._find_room()
        return True

    def _find_room(self) -> None:
        radius_cells = self._body.radius_m / self._grid.cell_m
        room = free_cells(self._map.explored, self._obstacles, radius_cells)
        self._room = room & ~self._blocked

    def _beside(self, place: Floats) -> NDArray[np.bool_]:
        own = self._grid.mask(place[None]).astype(np.uint8)
        side = 2 * BESIDE + 1
        return np.asarray(cv2.dilate(own, np.ones((side, side), np.uint8)), np.bool_)

    def _within(self, place: Floats, metres: float) -> NDArray[np.bool_]:
        """[M,M] cells whose middles are near a place (2,)."""
        rows, columns = np.indices(self._blocked.shape)
        middles = self._grid.centers(np.stack([rows.ravel(), columns.ravel()], axis=1))
        near = np.linalg.norm(middles - place, axis=1) <= metres
        return np.asarray(near.reshape(self._blocked.shape), np.bool_)


def _square(reach: int) -> NDArray[np.intp]:
    """[S,2] offsets to the cells of a square."""
    side = np.arange(-reach, reach + 1)
    return np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
