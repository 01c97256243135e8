"""Where on the floor a round robot can go."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gslts.types import Floats
from gslts_sim.home import Home, Room
from gslts_sim.physics import OrientedBoxes, boxes_in_world

STEP_M = 0.02
"""The robot drives over what is no higher, such as rugs."""
WALL_M = 0.3
"""Rooms no farther apart share a wall: the floor goes on between them where nothing stands. It is
a thick inner wall; wider doorways need a floor, which is a room, of their own."""


@dataclass(frozen=True, eq=False)
class WalkableFloor:
    """The floor of a room, or of several, on a grid, row = y, column = x.

    Args:
        origin: (2,) float64, m: the centre of cell (0, 0).
        cell_m: Edge of a cell.
        free: [rows,columns] bool: floor with nothing on it below the robot's height.
        standing: [rows,columns] bool: the middle of the robot can be there.
        largest: [rows,columns] bool: the largest part of `standing` that hangs together.
        reached: [rows,columns] bool: what the robot's body sweeps from the largest part.
    """

    origin: Floats
    cell_m: float
    free: NDArray[np.bool_]
    standing: NDArray[np.bool_]
    largest: NDArray[np.bool_]
    reached: NDArray[np.bool_]

    @property
    def reached_fraction(self) -> float:
        """Share of the free floor that the robot's body reaches; 0 where no floor is free."""
        return float((self.reached & self.free).sum() / max(1, self.free.sum()))

    def is_free(self, position: Floats) -> bool:
        """Whether there is room for the robot at (2,) x and y, m, reached or not."""
        return self._at(self.standing, position)

    def can_stand(self, position: Floats) -> bool:
        """Whether the middle of the robot can be at (2,) x and y, m, in the largest part."""
        return self._at(self.largest, position)

    def reachable_from(self, position: Floats) -> NDArray[np.bool_]:
        """[rows,columns] bool: the part of `standing` that hangs together with a place.

        Args:
            position: (2,) x and y, m.

        Returns:
            No cell at all where there is no room for the robot at the place.
        """
        cell = self._cell(position)
        part: list[int] = []
        if cell is not None and self.standing[cell]:
            start = int(np.ravel_multi_index(cell, self.standing.shape))
            part = _flooded(self.standing.ravel().tolist(), start, self.standing.shape[1])
        return _mask_of(part, self.standing.shape)

    def grid_positions(self, spacing_m: float, start: Floats | None = None) -> Floats:
        """[P,2] points of a grid through the world's origin on which the robot can stand, m.

        Args:
            spacing_m: Of the grid.
            start: (2,) x and y, m: only what hangs together with it counts; without it, the
                largest part does.
        """
        part = self.largest if start is None else self.reachable_from(start)
        end = self.origin + self.cell_m * np.array(part.shape[::-1])
        first = np.ceil((self.origin - self.cell_m) / spacing_m) * spacing_m
        x, y = (np.arange(first[k], end[k], spacing_m) for k in range(2))
        points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        return points[np.array([self._at(part, point) for point in points], np.bool_)]

    def _at(self, mask: NDArray[np.bool_], position: Floats) -> bool:
        cell = self._cell(position)
        return cell is not None and bool(mask[cell])

    def _cell(self, position: Floats) -> tuple[int, int] | None:
        """Row and column of a place; None outside of the grid."""
        column, row = np.rint((np.asarray(position) - self.origin) / self.cell_m)
        rows, columns = self.standing.shape
        return (int(row), int(column)) if 0 <= row < rows and 0 <= column < columns else None


def walkable_floor(
    home: Home, room: Room, radius_m: float = 0.2, height_m: float = 1.2, cell_m: float = 0.05
) -> WalkableFloor:
    """Where in a room, or in all of them, an upright cylinder can stand, move and reach.

    There is floor in the home's rooms, and between two of them that are at most WALL_M apart along
    x or y. The robot stays as far from its rim, which is met to half a cell, as from a wall.

    Args:
        home: With all its objects.
        room: One of its rooms, or `home.space` for all that are as low as the lowest.
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
    inside = _in_rooms(home, room, shape, cell_m)
    free = inside & (distance > 0)
    standing = (distance >= radius_m) & (to_wall >= radius_m)
    standing &= ~_dilated(~inside, radius_m / cell_m, half=0.5)
    largest = _largest_component(standing)
    return WalkableFloor(
        origin, cell_m, free, standing, largest, _dilated(largest, radius_m / cell_m)
    )


def _in_rooms(home: Home, around: Room, shape: tuple[int, ...], cell_m: float) -> NDArray[np.bool_]:
    """Cells whose centres are in a room as low as `around`, or in a wall between two."""
    inside = np.zeros(shape, np.bool_)
    for room in home.rooms:
        if abs(room.box[0, 2] - around.box[0, 2]) <= STEP_M:
            first, last = np.rint((room.box[:, :2] - around.box[0, :2]) / cell_m).astype(int)
            (x0, y0), (x1, y1) = np.maximum((first, np.maximum(last, first + 1)), 0)
            inside[y0:y1, x0:x1] = True
    most = round(WALL_M / cell_m)
    return _closed(_closed(inside, most).T, most).T


def _closed(mask: NDArray[np.bool_], most: int) -> NDArray[np.bool_]:
    """The mask with the gaps of at most so many cells in its rows filled."""
    columns = np.arange(mask.shape[1], dtype=np.float64)
    before = np.maximum.accumulate(np.where(mask, columns, -np.inf), axis=1)
    after = np.minimum.accumulate(np.where(mask, columns, np.inf)[:, ::-1], axis=1)[:, ::-1]
    filled: NDArray[np.bool_] = mask | (after - before <= most + 1)
    return filled


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
    open_cells = mask.ravel().tolist()
    best: list[int] = []
    for start in range(len(open_cells)):
        if open_cells[start]:
            best = max(best, _flooded(open_cells, start, mask.shape[1]), key=len)
    return _mask_of(best, mask.shape)


def _flooded(open_cells: list[bool], start: int, width: int) -> list[int]:
    """The open cells that hang together with one of them by their edges; closes them."""
    last_row = len(open_cells) - width
    open_cells[start] = False
    cells = [start]
    for cell in cells:  # Grows on the way.
        column = cell % width
        for near, inside in (
            (cell - width, cell >= width),
            (cell + width, cell < last_row),
            (cell - 1, column > 0),
            (cell + 1, column < width - 1),
        ):
            if inside and open_cells[near]:
                open_cells[near] = False
                cells.append(near)
    return cells


def _mask_of(cells: list[int], shape: tuple[int, ...]) -> NDArray[np.bool_]:
    mask = np.zeros(shape, np.bool_)
    mask.flat[cells] = True
    return mask


def _dilated(mask: NDArray[np.bool_], radius: float, half: float = 0.0) -> NDArray[np.bool_]:
    """Cells whose centre is within `radius` of squares about those of the mask.

    Args:
        mask: [rows,columns].
        radius: In cells.
        half: Half the edge of the squares, in cells: 0 for points, 0.5 for whole cells.
    """
    reach = int(radius + half)
    padded = np.pad(mask, reach)
    height, width = mask.shape
    result = np.zeros_like(mask)
    for dy in range(-reach, reach + 1):
        for dx in range(-reach, reach + 1):
            if np.hypot(max(abs(dy) - half, 0), max(abs(dx) - half, 0)) <= radius:
                result |= padded[reach + dy : reach + dy + height, reach + dx : reach + dx + width]
    return result
