"""Square grid on the floor; rows along y, columns along x."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gslts.types import Bools, Floats, Indices

MAX_SIDE_CELLS = 4096
"""Maximum number of cells along an edge: 200 m in cells of 0.05 m. Bounds memory where stray
Gaussians set the extent of a map."""


@dataclass(frozen=True, eq=False)
class Grid:
    """M x M cells on the floor.

    Args:
        origin: (2,) float64, corner of cell (0, 0) with the smallest x and y, world, m.
        cell_m: Edge of a cell, m.
        size: M.

    Raises:
        ValueError: `cell_m` is not positive, or the size is not in 1..`MAX_SIDE_CELLS`.
    """

    origin: Floats
    cell_m: float
    size: int

    def __post_init__(self) -> None:
        if not (np.isfinite(self.cell_m) and self.cell_m > 0):
            raise ValueError(f"Grid: cell_m: must be positive, got {self.cell_m}")
        if not 1 <= self.size <= MAX_SIDE_CELLS:
            raise ValueError(f"Grid: size must be in 1..{MAX_SIDE_CELLS}, got {self.size}")

    @classmethod
    def around(cls, low: Floats, high: Floats, cell_m: float, margin_m: float) -> Grid:
        """Make a grid with the centre of a box.

        Args:
            low: (2,) smallest x and y of the box, world, m.
            high: (2,) largest x and y of the box, world, m.
            cell_m: Edge of a cell, m.
            margin_m: Minimum distance from the box to the border of the grid, m.

        Returns:
            The grid.

        Raises:
            ValueError: As of the class.
        """
        size = int(np.ceil((float((high - low).max()) + 2 * margin_m) / cell_m))
        return cls((low + high) / 2 - size * cell_m / 2, cell_m, size)

    def cells(self, points: Floats) -> Indices:
        """Compute the cells of points, which may be outside the grid.

        Args:
            points: [P,2] or [P,3], world, m.

        Returns:
            [P,2] rows and columns.
        """
        cells: Indices = np.floor((points[:, 1::-1] - self.origin[::-1]) / self.cell_m).astype(
            np.intp
        )
        return cells

    def centers(self, cells: Indices) -> Floats:
        """Compute the centres of cells.

        Args:
            cells: [P,2] rows and columns.

        Returns:
            [P,2] x and y, world, m.
        """
        centers: Floats = self.origin + (cells[:, ::-1] + 0.5) * self.cell_m
        return centers

    def contains(self, cells: Indices) -> Bools:
        """Test if cells are in the grid.

        Args:
            cells: [P,2] rows and columns.

        Returns:
            [P] bool.
        """
        return np.asarray(((cells >= 0) & (cells < self.size)).all(axis=1))

    def mask(self, points: Floats) -> Bools:
        """Compute the cells that contain points.

        Args:
            points: [P,2] or [P,3], world, m.

        Returns:
            [M,M] bool.
        """
        result = np.zeros((self.size, self.size), np.bool_)
        cells = self.cells(points)
        result[tuple(cells[self.contains(cells)].T)] = True
        return result

    def cells_within(self, position: Floats, radius_m: float) -> Bools:
        """Compute the cells with centres near a position.

        Args:
            position: (2,) x and y in the world, m.
            radius_m: Maximum distance, m.

        Returns:
            [M,M] bool.
        """
        result = np.zeros((self.size, self.size), np.bool_)
        corners = self.cells(position + radius_m * np.array([[-1.0], [1.0]]))
        low, high = (corners + np.array([[0], [1]])).clip(0, self.size).tolist()
        rows, columns = (np.arange(start, end) for start, end in zip(low, high, strict=True))
        x = self.origin[0] + (columns + 0.5) * self.cell_m - position[0]
        y = self.origin[1] + (rows + 0.5) * self.cell_m - position[1]
        near = np.square(x)[None] + np.square(y)[:, None] <= radius_m**2
        result[low[0] : high[0], low[1] : high[1]] = near
        return result

    def sums(self, points: Floats, weights: Floats) -> Floats:
        """Sum weights of points by cell.

        Args:
            points: [P,2] or [P,3], world, m.
            weights: [P].

        Returns:
            [M,M].
        """
        cells = self.cells(points)
        inside = self.contains(cells)
        flat = cells[inside, 0] * self.size + cells[inside, 1]
        sums: Floats = np.bincount(flat, weights[inside], minlength=self.size**2).astype(np.float64)
        return sums.reshape(self.size, self.size)
