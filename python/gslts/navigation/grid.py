"""Square cells on the floor, row = y, column = x."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gslts.types import Floats

Cells = NDArray[np.intp]

MOST_CELLS = 4096
"""Along an edge: 200 m in cells of 0.05 m."""


@dataclass(frozen=True, eq=False)
class Grid:
    """M x M cells.

    Args:
        origin: (2,) float64, the corner of cell (0, 0) with the least x and y, world, m.
        cell_m: Edge of a cell.
        size: M.

    Raises:
        ValueError: There is no cell, or there are too many.
    """

    origin: Floats
    cell_m: float
    size: int

    def __post_init__(self) -> None:
        if not (np.isfinite(self.cell_m) and self.cell_m > 0):
            raise ValueError(f"Grid: cell_m: must be positive, got {self.cell_m}")
        if not 1 <= self.size <= MOST_CELLS:
            raise ValueError(f"Grid: size must be in 1..{MOST_CELLS}, got {self.size}")

    @classmethod
    def around(cls, low: Floats, high: Floats, cell_m: float, margin_m: float) -> Grid:
        """A grid whose middle is that of a box.

        Args:
            low: (2,) x and y, m.
            high: (2,) x and y, m.
            cell_m: Edge of a cell.
            margin_m: Between the box and the border, at least.
        """
        size = int(np.ceil((float((high - low).max()) + 2 * margin_m) / cell_m))
        return cls((low + high) / 2 - size * cell_m / 2, cell_m, size)

    def cells(self, points: Floats) -> Cells:
        """[P,2] row and column of points [P,2 or 3], x and y in the world, m; maybe outside."""
        cells: Cells = np.floor((points[:, 1::-1] - self.origin[::-1]) / self.cell_m).astype(
            np.intp
        )
        return cells

    def centers(self, cells: Cells) -> Floats:
        """[P,2] x and y of the middles of cells [P,2], world, m."""
        middles: Floats = self.origin + (cells[:, ::-1] + 0.5) * self.cell_m
        return middles

    def contains(self, cells: Cells) -> NDArray[np.bool_]:
        """[P] whether cells are in the grid."""
        return np.asarray(((cells >= 0) & (cells < self.size)).all(axis=1))

    def mask(self, points: Floats) -> NDArray[np.bool_]:
        """[M,M] cells with points [P,2 or 3]."""
        result = np.zeros((self.size, self.size), np.bool_)
        cells = self.cells(points)
        result[tuple(cells[self.contains(cells)].T)] = True
        return result

    def sums(self, points: Floats, weights: Floats) -> Floats:
        """[M,M] sum of the weights [P] of points [P,2 or 3] in each cell."""
        cells = self.cells(points)
        inside = self.contains(cells)
        flat = cells[inside, 0] * self.size + cells[inside, 1]
        sums: Floats = np.bincount(flat, weights[inside], minlength=self.size**2).astype(np.float64)
        return sums.reshape(self.size, self.size)
