"""The 2D semantic map of GS-LTS, sec. III-B: obstacles, what was explored, and categories."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from gslts.core.gaussian_map import GaussianMap
from gslts.core.robot_body import RobotBody
from gslts.navigation.grid import Grid
from gslts.navigation.surface_points import SurfacePoints, floor_height_m, sample_surfaces
from gslts.semantics.categories import Categories, classify_gaussians
from gslts.types import Floats

Mask = NDArray[np.bool_]

CELLS_A_RADIUS = 4
"""Of the robot: a way that is as wide as it is is told from one that is not."""
ROUGH_M = 0.04
"""So far above the step that a robot climbs begin obstacles: Gaussians of a floor are rough."""
LEAST_COVER = 0.3
"""Area of surfaces in a cell over that of the cell, from which on something is there; a wall that
is seen from above has far more."""
LEAST_GAUSSIANS = 5
"""In a cell and its eight neighbours: a stray one is no obstacle."""
BELOW_M = 0.15
"""What is so little below the floor is part of it: Gaussians of smooth floors lie deeper."""
MARGIN_M = 0.5
"""Unknown cells around a map."""
GAP = 3
"""Side, in cells, of what closes gaps between the Gaussians of a floor."""


@dataclass(frozen=True, eq=False)
class SemanticMap:
    """What is where on the floor.

    Attributes:
        grid: Of its M x M cells.
        layers: [L+2,M,M] bool: obstacles, explored, and the L categories.
        categories: Names of the L categories.
        floor_m: Height of the floor in the world.
    """

    grid: Grid
    layers: Mask
    categories: tuple[str, ...]
    floor_m: float

    @property
    def obstacles(self) -> Mask:
        """[M,M] what a robot would run into."""
        return np.asarray(self.layers[0])

    @property
    def explored(self) -> Mask:
        """[M,M] where the map knows a floor or something on it."""
        return np.asarray(self.layers[1])

    def category(self, name: str) -> Mask:
        """[M,M] where a category is.

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
    """Flattens a map of Gaussians along z.

    What is higher than the robot tells nothing of the floor below it: it is in the layers of
    categories only.

    Args:
        gaussian_map: With features if there are categories.
        body: Of the robot.
        categories: Of the layers; None for none.
        cell_m: Edge of a cell; None means a quarter of the radius of the robot.

    Raises:
        ValueError: No Gaussian is opaque, there are too many cells, or the features are not those
            that the categories are told from.
    """
    cell_m = body.radius_m / CELLS_A_RADIUS if cell_m is None else cell_m
    points = sample_surfaces(gaussian_map, cell_m)
    if len(points.rows) == 0:
        raise ValueError("semantic_map: gaussian_map: it has no opaque Gaussian")
    floor_m = floor_height_m(points)
    grid = Grid.around(*points.extent(cell_m), cell_m, MARGIN_M)
    heights = points.points[:, 2] - floor_m
    near = (heights >= -BELOW_M) & (heights <= body.height_m)
    obstacles = _solid(grid, points, near & (heights > body.step_m + ROUGH_M))
    known = obstacles | (_cover(grid, points, near & points.level) >= LEAST_COVER)
    closed = cv2.morphologyEx(
        known.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((GAP, GAP), np.uint8)
    )
    explored = _without_nooks(closed > 0, obstacles, body.radius_m / cell_m)
    layers = [obstacles, explored]
    if categories is not None:
        layers += _of_categories(grid, points, gaussian_map, categories)
    names = () if categories is None else categories.names
    return SemanticMap(grid, np.stack(layers), names, floor_m)


def _without_nooks(explored: Mask, obstacles: Mask, radius_cells: float) -> Mask:
    """Explored cells but for free spots that are smaller than the robot, as behind windows."""
    free = explored & ~obstacles
    _, parts, stats, _ = cv2.connectedComponentsWithStats(free.astype(np.uint8), connectivity=4)
    small = stats[:, cv2.CC_STAT_AREA] < np.pi * radius_cells**2
    kept: Mask = explored & ~(free & small[parts])
    return kept


def _solid(grid: Grid, points: SurfacePoints, chosen: Mask) -> Mask:
    """[M,M] cells in which there is enough surface, from more than a stray Gaussian."""
    counts = grid.sums(points.points[chosen], points.shares[chosen])
    around = cv2.boxFilter(counts, -1, (3, 3), normalize=False, borderType=cv2.BORDER_CONSTANT)
    solid: Mask = (_cover(grid, points, chosen) >= LEAST_COVER) & (around >= LEAST_GAUSSIANS)
    return solid


def _cover(grid: Grid, points: SurfacePoints, chosen: Mask) -> Floats:
    """[M,M] area of surfaces in each cell over that of the cell."""
    areas_m2 = grid.sums(points.points[chosen], points.areas_m2[chosen])
    cover: Floats = areas_m2 / grid.cell_m**2
    return cover


def _of_categories(
    grid: Grid, points: SurfacePoints, gaussian_map: GaussianMap, categories: Categories
) -> list[Mask]:
    """The layers; of each voxel, only the Gaussian with the most surface in it is asked."""
    asked = points.most_of_voxels(grid.cell_m)
    rows, place = np.unique(points.rows[asked], return_inverse=True)
    names = categories.names
    of_rows = classify_gaussians(
        gaussian_map, rows, categories.autoencoder, categories.source, names
    )
    of_points = of_rows[place]
    places = points.points[asked]
    return [grid.mask(places[of_points == number]) for number in range(len(names))]
