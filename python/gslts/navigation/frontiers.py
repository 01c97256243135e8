"""Exploration of a room without a map: to frontiers, and to floor that was not seen from near.

Source: Yamauchi 1997, "A frontier-based approach for autonomous exploration".
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from gslts.core.robot_body import RobotBody
from gslts.navigation.observed_floor import ObservedFloor
from gslts.navigation.planner import distance_field_m, free_cells, start_cells
from gslts.types import Bools, Floats

SPACING_M = 1.0
"""Default maximum distance of floor from the nearest position where the robot looked around, m: a
map shows blurred what was seen from afar only."""
FRONTIER_M = 0.4
"""Minimum length of a frontier, m: the robot passes no narrower gap."""
REPEAT_M = 0.3
"""Distance from an earlier goal below which no other is given, m: the robot stood there, or cannot
come nearer."""
SEEN_M = 2.0
"""Radius around a goal in which its frontier counts as seen from there, m. What is still unknown
after the robot has looked from so near is hidden."""
MAX_CLEARANCE_M = 0.5
"""Distance from obstacles that is worth a detour as long, m: from beside a wall, the robot sees
little but the wall."""
NEIGHBOUR_CELLS = 1.5
"""Radius in which the neighbours of a cell are, diagonal ones too, in cells."""
BLOCKED_RADIUS_M = 0.15
"""Radius of the floor that is blocked where the robot did not arrive, m."""
MAX_BLIND_M = 1.5
"""Maximum distance of the nearest floor that the camera sees at the start, m; the floor between is
taken for free. Beyond it, the robot stands between obstacles, or its camera sees no floor."""


@dataclass(frozen=True, eq=False)
class ExplorationGoal:
    """A position from which the robot should look around next.

    Attributes:
        position: (2,) x and y in the world, m.
        yaw_rad: Direction towards what is unknown, about z from x to y, rad.
        path_m: Length of the path there, m.
        is_frontier: True if there is unknown floor; False if the floor there was seen from afar.
    """

    position: Floats
    yaw_rad: float
    path_m: float
    is_frontier: bool


class FrontierExplorer:
    """Chooses where a robot explores, nearest goals first, until nothing is left that it can reach.

    Args:
        floor: Filled with the frames of the robot between two goals.
        body: Size of the robot.
        spacing_m: Maximum distance of reachable floor from the nearest goal, m.

    Attributes:
        floor: The floor so far.
    """

    def __init__(self, floor: ObservedFloor, body: RobotBody, spacing_m: float = SPACING_M) -> None:
        self.floor, self._body, self._spacing_m = floor, body, spacing_m
        size = floor.grid.size
        self._tried, self._blocked = np.zeros((2, size, size), np.bool_)
        self._goals: list[Floats] = []

    def next_goal(self, position: Floats) -> ExplorationGoal | None:
        """Choose the next goal; the robot has looked around where it is.

        Args:
            position: (2,) position of the robot, x and y in the world, m.

        Returns:
            The goal; None if all floor that the robot can reach is known and was seen from near.

        Raises:
            ValueError: At the start, no floor is seen near the robot.
        """
        if not self._goals:
            self._bridge_blind_floor(position)
        self._visit(position, None)
        lengths_m = self._path_lengths_m(position)
        goals = [*self._frontier_goals(lengths_m), *self._distant_goals(lengths_m)]
        if not goals:
            return None
        goal, frontier = min(goals, key=lambda pair: pair[0].path_m)
        self._visit(goal.position, frontier)
        return goal

    def block(self, position: Floats) -> None:
        """Block the floor around a goal where the robot did not arrive.

        Args:
            position: (2,) x and y in the world, m.
        """
        self._blocked |= self.floor.grid.cells_within(position, BLOCKED_RADIUS_M)

    def free(self) -> Bools:
        """Return [M,M] the cells in which the centre of the robot can be, reachable or not."""
        known = self.floor.semantic_map
        radius_cells = self._body.radius_m / self.floor.grid.cell_m
        free = free_cells(known.explored, known.obstacles, radius_cells)
        return (free | self.floor.driven) & ~self._blocked

    def _bridge_blind_floor(self, position: Floats) -> None:
        """Take the floor between the robot and the nearest that it sees for free."""
        known, grid = self.floor.semantic_map, self.floor.grid
        seen = known.explored & ~known.obstacles
        seen &= ~self.floor.grid.cells_within(position, self._body.radius_m + 2 * grid.cell_m)
        cells = np.argwhere(seen)
        offsets_m = np.linalg.norm(grid.centers(cells) - position, axis=1)
        nearest_m = float(offsets_m.min(initial=np.inf))
        if nearest_m > MAX_BLIND_M:
            x, y = position.tolist()
            raise ValueError(
                f"no floor at height {self.floor.floor_m:.2f} m is seen within {MAX_BLIND_M} m of "
                f"the robot at ({x:.2f}, {y:.2f}) m; check the pose of its camera, or tilt it down"
            )
        self.floor.assume_free(position, nearest_m + grid.cell_m)

    def _visit(self, position: Floats, frontier: Bools | None) -> None:
        """Give no more goals near a position, nor for the part of a frontier near it."""
        self._goals.append(position)
        if frontier is not None:
            self._tried |= frontier & self.floor.grid.cells_within(position, SEEN_M)

    def _path_lengths_m(self, position: Floats) -> Floats:
        """Return [M,M] lengths of paths from a position, m; infinite where there is none."""
        free, grid = self.free(), self.floor.grid
        return distance_field_m(free, start_cells(grid, free, position), grid.cell_m)

    def _frontier_goals(self, lengths_m: Floats) -> list[tuple[ExplorationGoal, Bools]]:
        """Return for each frontier the reachable position nearest to it, and its cells."""
        known, grid = self.floor.semantic_map, self.floor.grid
        beside = cv2.dilate((~known.explored).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        cells = known.explored & ~known.obstacles & beside & ~self._tried
        count, components = cv2.connectedComponents(cells.astype(np.uint8), connectivity=8)
        reachable = np.argwhere(np.isfinite(lengths_m))
        goals = []
        for number in range(1, count):
            frontier = components == number
            own = np.argwhere(frontier)
            if len(own) * grid.cell_m < FRONTIER_M or len(reachable) == 0:
                continue
            middle = own[np.argmin(np.linalg.norm(own - own.mean(axis=0), axis=1))]
            cell = reachable[np.argmin(np.linalg.norm(reachable - middle, axis=1))]
            position, target = grid.centers(np.array([cell, middle]))
            if self._is_new(position[None], REPEAT_M)[0]:
                radius_m = max(FRONTIER_M / 2, NEIGHBOUR_CELLS * grid.cell_m)
                unknown = ~known.explored & grid.cells_within(target, radius_m)
                x, y = (grid.centers(np.argwhere(unknown)).mean(axis=0) - position).tolist()
                yaw_rad, length_m = float(np.arctan2(y, x)), float(lengths_m[tuple(cell)])
                goals.append((ExplorationGoal(position, yaw_rad, length_m, True), frontier))
        return goals

    def _distant_goals(self, lengths_m: Floats) -> list[tuple[ExplorationGoal, None]]:
        """Return the nearest reachable position that is too far from all goals so far, if any."""
        cells = np.argwhere(np.isfinite(lengths_m))
        positions = self.floor.grid.centers(cells)
        distant = self._is_new(positions, self._spacing_m)
        if not distant.any():
            return []
        at = tuple(cells[distant].T)
        clearances_m = self._clearances_m()[at].clip(max=MAX_CLEARANCE_M)
        row = int(np.argmin(lengths_m[at] - clearances_m))
        position = positions[distant][row]
        x, y = (position - self._goals[-1]).tolist()
        yaw_rad, length_m = float(np.arctan2(y, x)), float(lengths_m[at][row])
        return [(ExplorationGoal(position, yaw_rad, length_m, False), None)]

    def _clearances_m(self) -> Floats:
        """Return [M,M] distances to the nearest cell where the robot cannot be, m."""
        distances = cv2.distanceTransform(
            self.free().astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE
        )
        return distances.astype(np.float64) * self.floor.grid.cell_m

    def _is_new(self, positions: Floats, distance_m: float) -> Bools:
        """Return [P] if positions [P,2] are farther than a distance from all goals so far."""
        offsets = positions[:, None] - np.array(self._goals)[None]
        new: Bools = np.linalg.norm(offsets, axis=2).min(axis=1, initial=np.inf) > distance_m
        return new
