"""Ways on a grid by fast marching (Sethian 1996), the planner of GS-LTS, sec. III-B."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from gslts.navigation.grid import Grid
from gslts.types import Floats

try:
    import skfmm
except ImportError as error:
    raise ImportError("ways need scikit-fmm: pip install 'gslts[tasks]'") from error

Mask = NDArray[np.bool_]
Cell = tuple[int, int]

MAX_START_OFFSET_M = 0.6
"""A robot that stands where the map has no room for it is led so far to where there is."""
OUT_MORE_M = 0.1
"""So much farther than the nearest such place may be the one where the way goes on."""
SAMPLES_PER_CELL = 4
"""Points of a straight line that are looked at."""
NEIGHBOURS = [(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0)]


@dataclass(frozen=True, eq=False)
class PlannedPath:
    """A way, or why there is none.

    Attributes:
        points: [P,2] its corners from start to goal, x and y in the world, m; none if there is no
            way.
        reason: Why there is none; empty if there is one.
    """

    points: Floats
    reason: str = ""

    @property
    def length_m(self) -> float:
        """Of the way; infinite if there is none."""
        if len(self.points) == 0:
            return float("inf")
        return float(np.linalg.norm(np.diff(self.points, axis=0), axis=1).sum())


def free_cells(explored: Mask, obstacles: Mask, radius_cells: float) -> Mask:
    """[M,M] cells where the middle of a robot can be.

    Args:
        explored: [M,M] cells that are known.
        obstacles: [M,M] cells to whose middles it keeps its radius.
        radius_cells: Of the robot, in cells.
    """
    far = cv2.distanceTransform((~obstacles).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    room: Mask = explored & (far >= radius_cells)
    return room


def distance_field_m(free: Mask, goals: Mask, cell_m: float) -> Floats:
    """[M,M] length of the shortest way to the nearest goal, m; infinite where there is none.

    Args:
        free: [M,M] cells that a way may lead through.
        goals: [M,M] of them, goals.
        cell_m: Edge of a cell.
    """
    goals = goals & free
    result = np.full(free.shape, np.inf)
    if not goals.any():
        return result
    front = np.ma.MaskedArray(np.where(goals, 0.0, 1.0), ~free)
    if goals.sum() == free.sum():
        return np.where(goals, 0.0, np.inf)
    found = skfmm.distance(front, dx=cell_m)
    known = ~np.ma.getmaskarray(found)
    result[known] = np.ma.getdata(found)[known]
    # The march leaves 0 in parts that it does not reach.
    number, parts = cv2.connectedComponents(free.astype(np.uint8), connectivity=4)
    reached = np.zeros(number, np.bool_)
    reached[np.unique(parts[goals])] = True
    return np.where(reached[parts] & free, result, np.inf)


def plan_path(grid: Grid, free: Mask, start: Floats, goals: Mask) -> PlannedPath:
    """The shortest way from a place to the nearest goal.

    Args:
        grid: Of the cells.
        free: [M,M] cells that a way may lead through.
        start: (2,) x and y in the world, m; if it is not free, the way begins with a straight line
            to the nearest free cell from which there is one.
        goals: [M,M] cells to go to.
    """
    if not (goals & free).any():
        return PlannedPath(np.zeros((0, 2)), "there is no room at the goal")
    x, y = start.tolist()
    out = start_cells(grid, free, start)
    if not out.any():
        return PlannedPath(
            np.zeros((0, 2)),
            f"there is no free floor within {MAX_START_OFFSET_M} m of ({x:.2f}, {y:.2f})",
        )
    metres = distance_field_m(free, goals, grid.cell_m)
    cells = np.argwhere(out & np.isfinite(metres))
    if len(cells) == 0:
        return PlannedPath(np.zeros((0, 2)), f"no way leads from ({x:.2f}, {y:.2f}) to the goal")
    away_m = np.linalg.norm(grid.centers(cells) - start, axis=1)
    row, column = cells[np.argmin(away_m)].tolist()
    first = row, column
    corners = _pulled(grid, free, grid.centers(np.array(_descended(metres, first))))
    if len(corners) > 1 and is_line_free(grid, free, start, corners[1]):
        corners = corners[1:]
    return PlannedPath(np.array([start, *corners]))


def start_cells(grid: Grid, free: Mask, start: Floats) -> Mask:
    """[M,M] free cells at which ways from a place (2,) may begin: its own, or those near to it.

    They are all about as near as the nearest: what is farther may lie behind a wall.
    """
    own = grid.mask(start[None]) & free
    cells = np.argwhere(free)
    if own.any() or len(cells) == 0:
        return own
    away_m = np.linalg.norm(grid.centers(cells) - start, axis=1)
    near = away_m <= min(MAX_START_OFFSET_M, float(away_m.min()) + OUT_MORE_M)
    own[tuple(cells[near].T)] = True
    return own


def _descended(metres: Floats, first: Cell) -> list[Cell]:
    """Cells from one to a goal, each time to the neighbour where the field falls most steeply."""
    cells = [first]
    rows, columns = metres.shape
    while metres[cells[-1]] > 0:
        row, column = cells[-1]
        best, steepest = None, 0.0
        for i, j in NEIGHBOURS:
            r, c = row + i, column + j
            if not (0 <= r < rows and 0 <= c < columns and np.isfinite(metres[r, c])):
                continue
            if i and j and not (np.isfinite(metres[row, c]) and np.isfinite(metres[r, column])):
                continue  # It would cut a corner.
            slope = (metres[row, column] - metres[r, c]) / np.hypot(i, j)
            if slope > steepest:
                best, steepest = (r, c), slope
        if best is None:
            break  # A goal is in no cell below this one.
        cells.append(best)
    return cells


def _pulled(grid: Grid, free: Mask, points: Floats) -> list[Floats]:
    """The corners of a way pulled taut: from each, straight to the farthest that it sees."""
    corners, at = [points[0]], 0
    while at < len(points) - 1:
        low, high = at + 1, len(points) - 1
        while low < high:  # What is seen from a corner is nearly always the way up to some cell.
            middle = (low + high + 1) // 2
            if is_line_free(grid, free, points[at], points[middle]):
                low = middle
            else:
                high = middle - 1
        corners.append(points[low])
        at = low
    return corners


def is_line_free(grid: Grid, free: Mask, start: Floats, end: Floats) -> bool:
    """Whether a straight line leads through free cells only.

    Args:
        grid: Of the cells.
        free: [M,M].
        start: (2,) x and y in the world, m.
        end: (2,) likewise.
    """
    count = int(np.linalg.norm(end - start) / grid.cell_m * SAMPLES_PER_CELL) + 2
    cells = grid.cells(start + np.linspace(0, 1, count)[:, None] * (end - start))
    if not grid.contains(cells).all():
        return False
    rows, columns = cells.T
    # Of a step to a diagonal neighbour, both cells beside it must be free, too.
    beside = free[rows[:-1], columns[1:]] & free[rows[1:], columns[:-1]]
    return bool(free[rows, columns].all() and beside.all())
