"""Floor grid of a home: the cells that a cylindrical robot can reach."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gslts.core.robot_body import RobotBody
from gslts.types import Bools, Floats
from gslts_sim.actions import GRID_M
from gslts_sim.home import Home, Room
from gslts_sim.oriented_boxes import OrientedBoxes
from gslts_sim.physics import boxes_in_world
from gslts_sim.robot_body import BODY

WALL_M = 0.3
"""Maximum gap between two rooms in which the floor continues, m: a thick inner wall. Wider passages
need a floor, which is a room, of their own."""


@dataclass(frozen=True, eq=False)
class WalkableFloor:
    """Occupancy grid of the floor of one or several rooms, row = y, column = x.

    Args:
        origin: (2,) float64, m: the centre of cell (0, 0).
        cell_m: Edge of a cell, m.
        free: [rows,columns] bool: floor without obstacles below the robot's height.
        standing: [rows,columns] bool: the centre of the robot can be there.
        largest: [rows,columns] bool: the largest connected component of `standing`.
        reached: [rows,columns] bool: cells that the robot's body covers from there.
    """

    origin: Floats
    cell_m: float
    free: Bools
    standing: Bools
    largest: Bools
    reached: Bools

    @property
    def reached_fraction(self) -> float:
        """Fraction of the free floor that the robot's body reaches; 0 if no floor is free."""
        return float((self.reached & self.free).sum() / max(1, self.free.sum()))

    def is_free(self, position: Floats) -> bool:
        """Return whether the robot fits at a position, reachable or not.

        Args:
            position: (2,) x and y, m.
        """
        return self._at(self.standing, position)

    def can_stand(self, position: Floats) -> bool:
        """Return whether the robot fits at a position in the largest component.

        Args:
            position: (2,) x and y, m.
        """
        return self._at(self.largest, position)

    def reachable_from(self, position: Floats) -> Bools:
        """Return the connected component of `standing` at a position.

        Args:
            position: (2,) x and y, m.

        Returns:
            [rows,columns] bool; empty if the robot does not fit at the position.
        """
        cell = self._cell(position)
        part: list[int] = []
        if cell is not None and self.standing[cell]:
            start = int(np.ravel_multi_index(cell, self.standing.shape))
            part = _flood_fill(self.standing.ravel().tolist(), start, self.standing.shape[1])
        return _mask_of(part, self.standing.shape)

    def grid_positions(self, spacing_m: float, start: Floats | None = None) -> Floats:
        """Return the points of a grid through the world's origin at which the robot can stand.

        Args:
            spacing_m: Of the grid, m.
            start: (2,) x and y, m: only its connected component counts; None for the largest one.

        Returns:
            [P,2] x and y, m.
        """
        part = self.largest if start is None else self.reachable_from(start)
        end = self.origin + self.cell_m * np.array(part.shape[::-1])
        first = np.ceil((self.origin - self.cell_m) / spacing_m) * spacing_m
        x, y = (np.arange(first[k], end[k], spacing_m) for k in range(2))
        points = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        return points[np.array([self._at(part, point) for point in points], np.bool_)]

    def _at(self, mask: Bools, position: Floats) -> bool:
        cell = self._cell(position)
        return cell is not None and bool(mask[cell])

    def _cell(self, position: Floats) -> tuple[int, int] | None:
        """Return row and column of a position; None outside of the grid."""
        column, row = np.rint((np.asarray(position) - self.origin) / self.cell_m)
        rows, columns = self.standing.shape
        return (int(row), int(column)) if 0 <= row < rows and 0 <= column < columns else None


def walkable_floor(
    home: Home, room: Room, body: RobotBody = BODY, cell_m: float = 0.05
) -> WalkableFloor:
    """Compute the floor that a robot can use.

    There is floor in the home's rooms, and between two of them that are at most WALL_M apart along
    x or y. The robot stays as far from the edge of the floor as from a wall, to half a cell.

    Args:
        home: With all its objects.
        room: One of its rooms, or `home.space` for all rooms on the lowest level.
        body: Size of the robot.
        cell_m: Edge of the cells of the grid, m.
    """
    lower, upper = room.box[0, :2], room.box[1, :2]
    shape = tuple(np.maximum(1, np.round((upper - lower) / cell_m)).astype(int)[::-1])
    origin = lower + cell_m / 2
    every = OrientedBoxes.concatenate([boxes_in_world(obj) for obj in home.objects])
    low, high = every.bounds
    floor = room.box[0, 2]
    obstacles = (low[:, 2] < floor + body.height_m) & (high[:, 2] > floor + body.step_m)
    distance = np.full(shape, np.inf)
    for k in np.flatnonzero(obstacles):
        _lower_distances(distance, every, int(k), origin, cell_m, body.radius_m)
    rows, columns = np.indices(shape)
    to_wall = np.minimum.reduce(
        [
            columns * cell_m + cell_m / 2,
            rows * cell_m + cell_m / 2,
            upper[0] - origin[0] - columns * cell_m,
            upper[1] - origin[1] - rows * cell_m,
        ]
    )
    inside = _in_rooms(home, room, shape, cell_m, body.step_m)
    free = inside & (distance > 0)
    standing = (distance >= body.radius_m) & (to_wall >= body.radius_m)
    standing &= ~_dilate(~inside, body.radius_m / cell_m, half=0.5)
    largest = _largest_component(standing)
    reached = _dilate(largest, body.radius_m / cell_m)
    return WalkableFloor(origin, cell_m, free, standing, largest, reached)


def floor_of(home: Home) -> WalkableFloor:
    """Compute the floor of a home that the simulated robot can use.

    Args:
        home: With all its objects.
    """
    return walkable_floor(home, home.space)


def start_position(home: Home, floor: WalkableFloor) -> Floats:
    """Return the grid position nearest to the middle of a home, at which a robot starts.

    Args:
        home: The home.
        floor: Its floor.

    Returns:
        (2,) x and y, m.

    Raises:
        ValueError: The robot can stand nowhere.
    """
    positions = floor.grid_positions(GRID_M)
    if len(positions) == 0:
        raise ValueError(f"{home.name}: the robot can stand nowhere")
    middle = home.space.box.mean(axis=0)[:2]
    start: Floats = positions[np.argmin(np.linalg.norm(positions - middle, axis=1))]
    return start


def _in_rooms(
    home: Home, around: Room, shape: tuple[int, ...], cell_m: float, step_m: float
) -> Bools:
    """Return the cells whose centres are in a room as low as `around`, or in a wall between two."""
    inside = np.zeros(shape, np.bool_)
    for room in home.rooms:
        if abs(room.box[0, 2] - around.box[0, 2]) <= step_m:
            first, last = np.rint((room.box[:, :2] - around.box[0, :2]) / cell_m).astype(int)
            (x0, y0), (x1, y1) = np.maximum((first, np.maximum(last, first + 1)), 0)
            inside[y0:y1, x0:x1] = True
    max_gap = round(WALL_M / cell_m)
    return _close_gaps(_close_gaps(inside, max_gap).T, max_gap).T


def _close_gaps(mask: Bools, max_gap: int) -> Bools:
    """Fill the gaps of at most `max_gap` cells in the rows of a mask."""
    columns = np.arange(mask.shape[1], dtype=np.float64)
    before = np.maximum.accumulate(np.where(mask, columns, -np.inf), axis=1)
    after = np.minimum.accumulate(np.where(mask, columns, np.inf)[:, ::-1], axis=1)[:, ::-1]
    filled: Bools = mask | (after - before <= max_gap + 1)
    return filled


def _lower_distances(
    distance: Floats, every: OrientedBoxes, k: int, origin: Floats, cell_m: float, reach_m: float
) -> None:
    """Update a grid of distances to the nearest box with box k, up to `reach_m` around it."""
    axes, halves = every.axes[k], every.halves[k]
    # The footprint of a tilted box is approximated by that of the upright box around it.
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


def _largest_component(mask: Bools) -> Bools:
    """Return the largest 4-connected component; empty if the mask is."""
    open_cells = mask.ravel().tolist()
    best: list[int] = []
    for start in range(len(open_cells)):
        if open_cells[start]:
            best = max(best, _flood_fill(open_cells, start, mask.shape[1]), key=len)
    return _mask_of(best, mask.shape)


def _flood_fill(open_cells: list[bool], start: int, width: int) -> list[int]:
    """Return the 4-connected component of an open cell, and close its cells."""
    last_row = len(open_cells) - width
    open_cells[start] = False
    cells = [start]
    for cell in cells:  # Grows during the loop.
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


def _mask_of(cells: list[int], shape: tuple[int, ...]) -> Bools:
    mask = np.zeros(shape, np.bool_)
    mask.flat[cells] = True
    return mask


def _dilate(mask: Bools, radius: float, half: float = 0.0) -> Bools:
    """Dilate a mask [rows,columns] by a disc.

    Args:
        mask: Set cells are squares around their centres.
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
