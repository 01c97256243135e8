"""Path planning on a grid by fast marching (Sethian 1996), the planner of GS-LTS, sec. III-B."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from gslts._core.plan import distance_field
from gslts.navigation.grid import Grid
from gslts.types import Bools, Floats

Cell = tuple[int, int]

MAX_START_OFFSET_M = 0.6
"""Maximum distance from a start in an obstacle to the free cell where its path begins. Lets a robot
leave an obstacle that exists in the map only."""
START_TOLERANCE_M = 0.1
"""Free cells up to this much farther than the nearest one may begin the path as well. A larger
value would lead through walls."""
SAMPLES_PER_CELL = 4
"""Samples per cell length of a straight line when it is tested for obstacles."""
NEIGHBOURS = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0)]
"""Steps to the eight neighbours of a cell."""


@dataclass(frozen=True, eq=False)
class PlannedPath:
    """A path on the floor, or the reason why there is none.

    Attributes:
        points: [P,2] corners from start to goal, x and y in the world, m; empty if there is none.
        reason: Reason why there is no path; empty if there is one.
    """

    points: Floats
    reason: str = ""

    @property
    def length_m(self) -> float:
        """Length of the path, m; infinite if there is none."""
        if len(self.points) == 0:
            return float("inf")
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())


def free_cells(explored: Bools, obstacles: Bools, radius_cells: float) -> Bools:
    """Compute the cells in which the centre of a robot can be.

    Args:
        explored: [M,M] bool, known cells.
        obstacles: [M,M] bool; the robot keeps its radius away from their centres.
        radius_cells: Radius of the robot, in cells.

    Returns:
        [M,M] bool.
    """
    distances = cv2.distanceTransform(
        (~obstacles).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE
    )
    free: Bools = explored & (distances >= radius_cells)
    return free


def distance_field_m(free: Bools, goals: Bools, cell_m: float) -> Floats:
    """Compute the length of the shortest path from each cell to the nearest goal.

    Source: Sethian, Fast Marching Methods, 1999; of second order.

    Args:
        free: [M,M] bool, cells that a path may pass.
        goals: [M,M] bool; goals that are not free are ignored.
        cell_m: Edge of a cell, m.

    Returns:
        [M,M] m; infinite where there is no path.
    """
    return distance_field(free, goals, cell_m=cell_m)


def plan_path(grid: Grid, free: Bools, start: Floats, goals: Bools) -> PlannedPath:
    """Plan the shortest path to the nearest goal.

    Args:
        grid: The grid of the cells.
        free: [M,M] bool, cells that a path may pass.
        start: (2,) x and y in the world, m. If its cell is not free, the path begins with a
            straight line to the nearest free cell from which there is a path.
        goals: [M,M] bool, goal cells.

    Returns:
        The path, or the reason why there is none.
    """
    if not (goals & free).any():
        return PlannedPath(np.zeros((0, 2)), "there is no free cell at the goal")
    x, y = start.tolist()
    starts = start_cells(grid, free, start)
    if not starts.any():
        reason = f"there is no free floor within {MAX_START_OFFSET_M} m of ({x:.2f}, {y:.2f})"
        return PlannedPath(np.zeros((0, 2)), reason)
    field_m = distance_field_m(free, goals, grid.cell_m)
    cells = np.argwhere(starts & np.isfinite(field_m))
    if len(cells) == 0:
        return PlannedPath(
            np.zeros((0, 2)), f"there is no path from ({x:.2f}, {y:.2f}) to the goal"
        )
    offsets_m = np.linalg.norm(grid.centers(cells) - start, axis=1)
    row, column = cells[np.argmin(offsets_m)].tolist()
    descent = np.array(_descend(field_m, (row, column)))
    corners = _simplify(grid, free, grid.centers(descent))
    if len(corners) > 1 and is_line_free(grid, free, start, corners[1]):
        corners = corners[1:]
    return PlannedPath(np.array([start, *corners]))


def start_cells(grid: Grid, free: Bools, start: Floats) -> Bools:
    """Compute the free cells at which paths from a position may begin.

    Args:
        grid: The grid of the cells.
        free: [M,M] bool.
        start: (2,) x and y in the world, m.

    Returns:
        [M,M] bool: the cell of the position if it is free; otherwise the nearest free cells, all
        at about the same distance, as farther ones may be behind a wall.
    """
    own = grid.mask(start[None]) & free
    cells = np.argwhere(free)
    if own.any() or len(cells) == 0:
        return own
    offsets_m = np.linalg.norm(grid.centers(cells) - start, axis=1)
    near = offsets_m <= min(MAX_START_OFFSET_M, float(offsets_m.min()) + START_TOLERANCE_M)
    own[tuple(cells[near].T)] = True
    return own


def _descend(field_m: Floats, first: Cell) -> list[Cell]:
    """Return the cells of steepest descent of a distance field, from a cell to a goal."""
    cells = [first]
    rows, columns = field_m.shape
    while field_m[cells[-1]] > 0:
        row, column = cells[-1]
        best, steepest = None, 0.0
        for i, j in NEIGHBOURS:
            r, c = row + i, column + j
            if not (0 <= r < rows and 0 <= c < columns and np.isfinite(field_m[r, c])):
                continue
            if i and j and not (np.isfinite(field_m[row, c]) and np.isfinite(field_m[r, column])):
                continue  # A diagonal step must not cut the corner of an obstacle.
            slope = (field_m[row, column] - field_m[r, c]) / np.hypot(i, j)
            if slope > steepest:
                best, steepest = (r, c), slope
        if best is None:
            break  # A local minimum beside a goal.
        cells.append(best)
    return cells


def _simplify(grid: Grid, free: Bools, points: Floats) -> list[Floats]:
    """Simplify a path: from each corner straight to the farthest point with a free line."""
    corners, at = [points[0]], 0
    while at < len(points) - 1:
        low, high = at + 1, len(points) - 1
        while low < high:  # Bisection: free lines nearly always end at one point.
            middle = (low + high + 1) // 2
            if is_line_free(grid, free, points[at], points[middle]):
                low = middle
            else:
                high = middle - 1
        corners.append(points[low])
        at = low
    return corners


def is_line_free(grid: Grid, free: Bools, start: Floats, end: Floats) -> bool:
    """Test if a straight line passes free cells only.

    Args:
        grid: The grid of the cells.
        free: [M,M] bool.
        start: (2,) x and y in the world, m.
        end: (2,) x and y in the world, m.

    Returns:
        True if it does, and is in the grid.
    """
    count = int(np.linalg.norm(end - start) / grid.cell_m * SAMPLES_PER_CELL) + 2
    cells = grid.cells(start + np.linspace(0, 1, count)[:, None] * (end - start))
    if not grid.contains(cells).all():
        return False
    rows, columns = cells.T
    # Both cells beside a diagonal step must be free.
    beside = free[rows[:-1], columns[1:]] & free[rows[1:], columns[:-1]]
    return bool(free[rows, columns].all() and beside.all())
