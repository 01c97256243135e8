"""2D semantic map: obstacles, explored area and categories (GS-LTS, sec. III-B)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from gslts.core.gaussian_map import GaussianMap
from gslts.core.robot_body import RobotBody
from gslts.navigation.grid import Grid
from gslts.navigation.surface_points import SurfacePoints, floor_height_m, sample_surfaces
from gslts.semantics.categories import Categories, classify_gaussians
from gslts.types import Bools, Floats

CELLS_PER_RADIUS = 4
"""Default resolution: with four cells per radius of the robot, a passage as wide as the robot
differs from a narrower one."""
ROUGHNESS_M = 0.04
"""Minimum height of obstacles above the step that the robot climbs: Gaussians of a floor vary in
height by some centimetres."""
MIN_COVERAGE = 0.3
"""Minimum area of surfaces in a cell over the area of the cell, for the cell to be occupied or
explored. A wall seen from above has far more."""
MIN_GAUSSIANS, MIN_COUNT_SIDE_M = 5, 0.15
"""Minimum number of Gaussians of an obstacle in the square around a cell, and minimum side of this
square, m: three cells of the default robot. Removes single stray Gaussians. Gaussians of a wall are
centimetres apart: smaller squares in the fine grids of small robots would hold too few."""
MAX_BELOW_FLOOR_M = 0.15
"""Depth below the floor down to which surfaces belong to it: Gaussians of smooth floors are too
deep."""
MARGIN_M = 0.5
"""Margin of unknown cells around the map."""
CLOSING_CELLS = 3
"""Side of the morphological closing that fills gaps between the Gaussians of a floor."""


@dataclass(frozen=True, eq=False)
class SemanticMap:
    """2D semantic map, for planners.

    Attributes:
        grid: The M x M cells.
        layers: [L+2,M,M] bool: obstacles, explored area, and the L categories.
        categories: Names of the L categories.
        floor_m: Height of the floor, world z, m.
    """

    grid: Grid
    layers: Bools
    categories: tuple[str, ...]
    floor_m: float

    @property
    def obstacles(self) -> Bools:
        """[M,M] cells that a robot would collide with."""
        return np.asarray(self.layers[0])

    @property
    def explored(self) -> Bools:
        """[M,M] cells where the map has a floor or something on it."""
        return np.asarray(self.layers[1])

    def category(self, name: str) -> Bools:
        """Return the layer of a category.

        Args:
            name: Name of the category.

        Returns:
            [M,M] bool.

        Raises:
            ValueError: The map has no such layer.
        """
        if name not in self.categories:
            raise ValueError(f"category: expected one of {self.categories}, got {name!r}")
        return np.asarray(self.layers[2 + self.categories.index(name)])


def make_semantic_map(
    gaussian_map: GaussianMap,
    body: RobotBody,
    categories: Categories | None = None,
    cell_m: float | None = None,
) -> SemanticMap:
    """Project a map of Gaussians along z.

    Surfaces above the robot are in the layers of categories only, as they are no obstacles and do
    not show the floor.

    Args:
        gaussian_map: With features if there are categories.
        body: Size of the robot.
        categories: Categories of the layers; None for none.
        cell_m: Edge of a cell, m; None for a quarter of the radius of the robot.

    Returns:
        The semantic map.

    Raises:
        ValueError: No Gaussian is opaque, there are too many cells, or the features do not fit the
            categories.
    """
    cell_m = body.radius_m / CELLS_PER_RADIUS if cell_m is None else cell_m
    surfaces = sample_surfaces(gaussian_map, cell_m)
    if len(surfaces.rows) == 0:
        raise ValueError("make_semantic_map: gaussian_map: it has no opaque Gaussian")
    floor_m = floor_height_m(surfaces)
    grid = Grid.around(*surfaces.extent(cell_m), cell_m, MARGIN_M)
    heights = surfaces.points[:, 2] - floor_m
    below_top = (heights >= -MAX_BELOW_FLOOR_M) & (heights <= body.height_m)
    obstacles = _occupied_cells(grid, surfaces, below_top & (heights > body.step_m + ROUGHNESS_M))
    known = obstacles | (_coverage(grid, surfaces, below_top & surfaces.level) >= MIN_COVERAGE)
    closed = cv2.morphologyEx(
        known.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((CLOSING_CELLS, CLOSING_CELLS), np.uint8)
    )
    explored = _remove_small_areas(closed > 0, obstacles, body.radius_m / cell_m)
    layers = [obstacles, explored]
    if categories is not None:
        layers += _category_layers(grid, surfaces, gaussian_map, categories)
    names = () if categories is None else categories.names
    return SemanticMap(grid, np.stack(layers), names, floor_m)


def _remove_small_areas(explored: Bools, obstacles: Bools, radius_cells: float) -> Bools:
    """Remove free areas smaller than the robot, such as behind windows, from explored cells."""
    free = explored & ~obstacles
    _, components, stats, _ = cv2.connectedComponentsWithStats(
        free.astype(np.uint8), connectivity=4
    )
    is_small = stats[:, cv2.CC_STAT_AREA] < np.pi * radius_cells**2
    kept: Bools = explored & ~(free & is_small[components])
    return kept


def _occupied_cells(grid: Grid, surfaces: SurfacePoints, selected: Bools) -> Bools:
    """Return [M,M] cells with enough surface, from more than a stray Gaussian."""
    counts = grid.sums(surfaces.points[selected], surfaces.shares[selected])
    side = max(3, int(np.ceil(MIN_COUNT_SIDE_M / grid.cell_m - 1e-9)) | 1)  # Odd, in cells.
    nearby = cv2.boxFilter(
        counts, -1, (side, side), normalize=False, borderType=cv2.BORDER_CONSTANT
    )
    coverage = _coverage(grid, surfaces, selected)
    occupied: Bools = (coverage >= MIN_COVERAGE) & (nearby >= MIN_GAUSSIANS)
    return occupied


def _coverage(grid: Grid, surfaces: SurfacePoints, selected: Bools) -> Floats:
    """Return [M,M] area of surfaces in each cell over the area of the cell."""
    areas_m2 = grid.sums(surfaces.points[selected], surfaces.areas_m2[selected])
    coverage: Floats = areas_m2 / grid.cell_m**2
    return coverage


def _category_layers(
    grid: Grid, surfaces: SurfacePoints, gaussian_map: GaussianMap, categories: Categories
) -> list[Bools]:
    """Return the layers; the Gaussian with most surface in a voxel gives the voxel's category."""
    selected = surfaces.largest_per_voxel(grid.cell_m)
    rows, row_of = np.unique(surfaces.rows[selected], return_inverse=True)
    classes = classify_gaussians(
        gaussian_map, rows, categories.codec, categories.source, categories.names
    )[row_of]
    points = surfaces.points[selected]
    return [grid.mask(points[classes == number]) for number in range(len(categories.names))]
