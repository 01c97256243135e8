"""Free floor of a robot: of its map, and of obstacles met on the path."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import cv2
import numpy as np

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
from gslts.types import Bools, Floats, Indices

BLOCKED_RADIUS_M = 0.1
"""Radius around a position that the robot failed to reach, which is blocked from then on; also the
distance at which a position counts as reached."""
MIN_HEIGHT_M, MAX_HEIGHT_M = -0.5, 2.0
"""Range of heights of doors and cameras above their floor, m: tells storeys apart."""
POSITION_TOLERANCE_CELLS = 2
"""A position this many cells beside the free cells counts as free: outlines of obstacles in the map
are inaccurate."""


class Terrain:
    """Plans paths for one robot on one trip, and learns obstacles.

    Args:
        semantic_map: Of the home.
        body: Size of the robot.
    """

    def __init__(self, semantic_map: SemanticMap, body: RobotBody) -> None:
        self._map, self._body, self._grid = semantic_map, body, semantic_map.grid
        self._obstacles = semantic_map.obstacles.copy()
        self._blocked = np.zeros_like(self._obstacles)
        self._update_free()

    def path_lengths_m(self, start: Floats, positions: Floats) -> Floats:
        """Compute the lengths of the shortest paths to positions.

        Args:
            start: (2,) x and y in the world, m.
            positions: [K,2] x and y in the world, m.

        Returns:
            [K] m; infinite where there is no path.
        """
        starts = start_cells(self._grid, self._free, start)
        field_m = distance_field_m(self._free, starts, self._grid.cell_m)
        cells = self._grid.cells(positions)[:, None] + _square(POSITION_TOLERANCE_CELLS)
        inside = self._grid.contains(cells.reshape(-1, 2)).reshape(cells.shape[:2])
        rows, columns = np.where(inside[..., None], cells, 0).transpose(2, 0, 1)
        lengths = np.where(inside, field_m[rows, columns], np.inf).min(axis=1, initial=np.inf)
        is_there = np.linalg.norm(positions - start, axis=1) <= BLOCKED_RADIUS_M
        result: Floats = np.where(is_there, 0.0, lengths)
        return result

    def is_known(self, position: Floats) -> bool:
        """Test if there is free floor for the robot below or near the position of its camera.

        Args:
            position: (3,) world, m.

        Returns:
            True if there is, on the storey of the map.
        """
        is_inside = MIN_HEIGHT_M <= position[2] - self._map.floor_m <= MAX_HEIGHT_M
        return bool(is_inside and start_cells(self._grid, self._free, position[:2]).any())

    def plan(self, start: Floats, goal: Floats) -> PlannedPath:
        """Plan the shortest path between two positions.

        Args:
            start: (2,) x and y in the world, m.
            goal: (2,) x and y in the world, m.

        Returns:
            The path, or the reason why there is none.
        """
        if np.linalg.norm(goal - start) <= BLOCKED_RADIUS_M:
            return PlannedPath(np.array([start, goal]))
        goals = self._grid.mask(goal[None])
        if not (goals & self._free).any():
            goals = self._dilated_cell(goal)
        path = plan_path(self._grid, self._free, start, goals)
        return path if path.reason else PlannedPath(np.array([*path.points, goal]))

    def plan_near(self, start: Floats, goal: Floats) -> PlannedPath:
        """Plan the shortest path to the free floor nearest to a position.

        Args:
            start: (2,) x and y in the world, m.
            goal: (2,) x and y in the world, m.

        Returns:
            The path, or the reason why there is none.
        """
        return plan_path(self._grid, self._free, start, start_cells(self._grid, self._free, goal))

    def plan_to_any(self, start: Floats, goals: Floats) -> PlannedPath:
        """Plan the shortest path to the nearest of several positions.

        Args:
            start: (2,) x and y in the world, m.
            goals: [K,2] x and y in the world, m; those that are not free are ignored.

        Returns:
            The path, or the reason why there is none.
        """
        return plan_path(self._grid, self._free, start, self._grid.mask(goals))

    def free_positions(self) -> Floats:
        """Return [P,2] centres of the free cells, x and y in the world, m."""
        return self._grid.centers(np.argwhere(self._free))

    def is_free(self, path: Sequence[Floats]) -> bool:
        """Test if the straight lines of a path are free.

        Args:
            path: Corners (2,), x and y in the world, m.

        Returns:
            True if all are.
        """
        return all(
            is_line_free(self._grid, self._free, start, end) for start, end in pairwise(path)
        )

    def block(self, position: Floats, robot_position: Floats) -> None:
        """Block a position that the robot failed to reach.

        Args:
            position: (2,) x and y in the world, m.
            robot_position: (2,) where the robot is, which stays free.
        """
        own = self._grid.cells_within(robot_position, self._grid.cell_m)
        self._blocked |= self._grid.cells_within(position, BLOCKED_RADIUS_M) & ~own
        self._update_free()

    def add_obstacles(self, frame: RgbdFrame) -> bool:
        """Add the obstacles in a frame that are not known yet.

        Args:
            frame: At the pose that the robot believes.

        Returns:
            True if there are any.
        """
        new = detect_obstacles(frame, self._map, self._obstacles, self._body)
        if not new.any():
            return False
        self._obstacles |= new
        self._update_free()
        return True

    def _update_free(self) -> None:
        radius_cells = self._body.radius_m / self._grid.cell_m
        free = free_cells(self._map.explored, self._obstacles, radius_cells)
        self._free = free & ~self._blocked

    def _dilated_cell(self, position: Floats) -> Bools:
        own = self._grid.mask(position[None]).astype(np.uint8)
        side = 2 * POSITION_TOLERANCE_CELLS + 1
        return np.asarray(cv2.dilate(own, np.ones((side, side), np.uint8)), np.bool_)


def _square(reach: int) -> Indices:
    """Return [S,2] offsets to the cells of a square."""
    side = np.arange(-reach, reach + 1)
    return np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
