"""Paths of the robot on the floor of a home."""

from __future__ import annotations

import numpy as np

from gslts.navigation.grid import Grid
from gslts.navigation.planner import PlannedPath, plan_path
from gslts.types import Bools, Floats
from gslts_sim.walkable import WalkableFloor


def plan_route(floor: WalkableFloor, start: Floats, goal: Floats) -> PlannedPath:
    """Plan the shortest path to a goal, or to the reachable position nearest to it.

    Args:
        floor: Of the home.
        start: (2,) x and y, m.
        goal: (2,) x and y, m.

    Returns:
        The path, or the reason why there is none.
    """
    reachable = floor.reachable_from(start)
    if not reachable.any():  # An object was put down beside the robot.
        reachable = floor.largest
    size = max(reachable.shape)
    grid = Grid(floor.origin - floor.cell_m / 2, floor.cell_m, size)
    free = _square(reachable, size)
    goals = grid.mask(goal[None]) & free
    if goals.any():
        path = plan_path(grid, free, start, goals)
        path.points[-1:] = goal  # Exactly there, not at the centre of the cell.
        return path
    centers = grid.centers(np.argwhere(free))
    if len(centers) == 0:
        return PlannedPath(np.zeros((0, 2)), "the robot can stand nowhere")
    nearest = centers[np.argmin(np.linalg.norm(centers - goal, axis=1))]
    return plan_path(grid, free, start, grid.mask(nearest[None]))


def _square(mask: Bools, size: int) -> Bools:
    rows, columns = mask.shape
    return np.pad(mask, ((0, size - rows), (0, size - columns)))
