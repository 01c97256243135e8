"""Where on the floor a round robot can go."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gslts.sim.home import Floats, Home, Room
from gslts.sim.physics import OrientedBoxes, boxes_in_world

STEP_M = 0.02
"""The robot drives over what is no higher, such as rugs."""


@dataclass(frozen=True, eq=False)
class WalkableFloor:
    """The floor of a room on a grid, row = y, column = x.

    Args:
        origin: (2,) float64, m: the centre of cell (0, 0).
        cell_m: Edge of a cell.
        free: [rows,columns] bool: nothing below the robot's height stands there.
        standing: [rows,columns] bool: the middle of the robot can be there.
        largest: [rows,columns] bool: the largest part of `standing` that hangs together.
        reached: [rows,columns] bool: what the robot's body sweeps from there.
    """

    origin: Floats
    cell_m: float
    free: NDArray[np.bool_]
    standing: NDArray[np.bool_]
    largest: NDArray[np.bool_]
    reached: NDArray[np.bool_]

    @property
    def reached_share(self) -> float:
        """Share of the free floor that the robot's body reaches; 0 where no floor is free."""
        return float((self.reached & self.free).sum() / max(1, self.free.sum()))

    def can_stand(self, position: Floats) -> bool:
        """Whether the middle of the robot can be at (2,) x and y, m."""
        column, row = np.rint((position - self.origin) / self.cell_m).astype(int)
        rows, columns = self.largest.shape
        return bool(0 <= row < rows and 0 <= column < columns and self.largest[row, column])

    def places(self, spacing_m: float) -> Floats:
        """[P,2] points of a grid through the world's origin on which the robot can stand, m."""
        end = self.origin + self.cell_m * np.array(self.largest.shape[::-1])
        first = np.ceil((self.origin - self.cell_m) / spacing_m) * spacing_m
        x, y = (np.arange(first[k], end[k], spacing_m) for k in range(2))
        points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        return points[[self.can_stand(point) for point in points]]


def walkable_floor(
    home: Home, room: Room, radius_m: float = 0.2, height_m: float = 1.2, cell_m: float = 0.05
) -> WalkableFloor:
    """Where in a room an upright cylinder can stand, move and reach.

    Args:
        home: With all its objects.
        room: One of its rooms.
        radius_m: Of the robot.
        height_m: Of the robot; what hangs higher is no obstacle.
        cell_m: Edge of the cells of the grid.
    """
    lower, upper = room.box[0, :2], room.box[1, :2]
    shape = tuple(np.maximum(1, np.round((upper - lower) / cell_m)).astype(int)[::-1])
    origin = lower + cell_m / 2
    every = OrientedBoxes.joined([boxes_in_world(thing) for thing in home.objects])
    low, high = every.bounds
    floor = room.box[0, 2]
    in_the_way = (low[:, 2] < floor + height_m) & (high[:, 2] > floor + STEP_M)
    distance = np.full(shape, np.inf)
    for k in np.flatnonzero(in_the_way):
        _lower_distances(distance, every, int(k), origin, cell_m, radius_m)
    rows, columns = np.indices(shape)
    to_wall = np.minimum.reduce(
        [
            columns * cell_m + cell_m / 2,
            rows * cell_m + cell_m / 2,
            upper[0] - origin[0] - columns * cell_m,
            upper[1] - origin[1] - rows * cell_m,
        ]
    )
    free = distance > 0
    standing = (distance >= radius_m) & (to_wall >= radius_m)
    largest = _largest_component(standing)
    return WalkableFloor(
        origin, cell_m, free, standing, largest, _dilated(largest, radius_m / cell_m)
    )


def _lower_distances(
    distance: Floats, every: OrientedBoxes, k: int, origin: Floats, cell_m: float, reach_m: float
) -> None:
    """Enters box k into a grid of distances to the nearest box, as far as `reach_m` around it."""
    axes, halves = every.axes[k], every.halves[k]
    # The shadow of a tilted box is taken as that of the upright box around it.
    upright = axes[2, 2] > 1 - 1e-6
    frame = axes[:2, :2] if upright else np.eye(2)
    half = halves[:2] if upright else (np.abs(axes) @ halves)[:2]
    around = np.abs(frame) @ half + reach_m
    first = np.floor((every.centers[k, :2] - around - origin) / cell_m).astype(int)
    last = np.ceil((every.centers[k, :2] + around - origin) / cell_m).astype(int)
    (x0, y0), (x1, y1) = np.maximum(first, 0), np.minimum(last + 1, distance.shape[::-1])
    if x0 >= x1 or y0 >= y1:
        return
    x = origin[0] + cell_m * np.arange(x0, x1) - every.centers[k, 0]
    y = origin[1] + cell_m * np.arange(y0, y1) - every.centers[k, 1]
    along = np.abs(frame[0, 0] * x[None, :] + frame[1, 0] * y[:, None]) - half[0]
    across = np.abs(frame[0, 1] * x[None, :] + frame[1, 1] * y[:, None]) - half[1]
    to_box = np.sqrt(np.maximum(along, 0) ** 2 + np.maximum(across, 0) ** 2)
    part = distance[y0:y1, x0:x1]
    np.minimum(part, to_box, out=part)


def _largest_component(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The largest set of cells that hang together by their edges; empty if the mask is."""
    height, width = mask.shape
    open_cells = mask.ravel().tolist()
    best: list[int] = []
    for start in range(height * width):
        if not open_cells[start]:
            continue
        open_cells[start] = False
        cells, queue = [start], deque([start])
        while queue:
            cell = queue.popleft()
            column = cell % width
            for near, inside in (
                (cell - width, cell >= width),
                (cell + width, cell < (height - 1) * width),
                (cell - 1, column > 0),
                (cell + 1, column < width - 1),
            ):
                if inside and open_cells[near]:
                    open_cells[near] = False
                    cells.append(near)
                    queue.append(near)
        if len(cells) > len(best):
            best = cells
    result = np.zeros(height * width, np.bool_)
    result[best] = True
    return result.reshape(mask.shape)


def _dilated(mask: NDArray[np.bool_], radius: float) -> NDArray[np.bool_]:
    """Cells whose centre is within `radius` cells of one of the mask."""
    reach = int(radius)
    padded = np.pad(mask, reach)
    height, width = mask.shape
    result = np.zeros_like(mask)
    for dy in range(-reach, reach + 1):
        for dx in range(-reach, reach + 1):
            if dy * dy + dx * dx <= radius * radius:
                result |= padded[reach + dy : reach + dy + height, reach + dx : reach + dx + width]
    return result
