"""Points sampled on the surfaces of Gaussians, and the height of the floor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gslts.core.gaussian_map import GaussianMap
from gslts.mapping.density.control import axes_of
from gslts.types import Bools, Floats, Indices

MIN_OPACITY = 0.3
"""Gaussians below are not sampled: they are hardly visible."""
REACH_SIGMAS = 1.5
"""Extent of the surface of a Gaussian along its two long axes, in standard deviations."""
MAX_STEPS = 4
"""Maximum number of points to each side along an axis; larger Gaussians belong to windows and
skies."""
MAX_HEIGHT_M = 100.0
"""Maximum distance of a point from the median height when the floor is searched for; excludes stray
Gaussians."""
FLOOR_BIN_M = 0.02
"""Height of the bins of the histogram in which the floor is a peak."""
MIN_FLOOR_SHARE = 0.3
"""Minimum area of a horizontal layer over that of the largest one, for the floor."""
MIN_LEVEL_COSINE = 0.8
"""Minimum cosine of the angle between the normal of a horizontal surface and the vertical."""
DENSE_SQUARE_M, MIN_DENSE_POINTS = 0.25, 30
"""Squares of this edge with this many points count for the extent of the map; others are stray
Gaussians."""


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """Points on the opaque Gaussians of a map.

    Attributes:
        points: [P,3] world, m.
        rows: [P] row of the Gaussian of each point in the map.
        areas_m2: [P] opaque area that each point represents, m^2.
        shares: [P] share of each point in its Gaussian; those of a Gaussian sum to 1.
        level: [P] bool, horizontal surfaces.
    """

    points: Floats
    rows: Indices
    areas_m2: Floats
    shares: Floats
    level: Bools

    def extent(self, cell_m: float) -> tuple[Floats, Floats]:
        """Compute the extent of the map on the floor, without stray points.

        Args:
            cell_m: Edge of a cell of the semantic map, m.

        Returns:
            (2,) smallest and (2,) largest x and y, world, m.
        """
        edge_m = max(DENSE_SQUARE_M, cell_m)
        squares = np.floor(self.points[:, :2] / edge_m).astype(np.int64)
        first = squares.min(axis=0)
        width = int(squares[:, 1].max() - first[1]) + 1
        keys = (squares[:, 0] - first[0]) * width + squares[:, 1] - first[1]
        occupied, counts = np.unique(keys, return_counts=True)
        dense = occupied[counts >= min(MIN_DENSE_POINTS, counts.max())]
        kept = first + np.stack([dense // width, dense % width], axis=1)
        return kept.min(axis=0) * edge_m, (kept.max(axis=0) + 1) * edge_m

    def largest_per_voxel(self, edge_m: float) -> Indices:
        """Select the point with the largest area in each voxel.

        Args:
            edge_m: Edge of a voxel, m.

        Returns:
            [V] indices of points.
        """
        keys = np.floor(self.points / edge_m).astype(np.int64)
        keys -= keys.min(axis=0)
        flat = np.ravel_multi_index(tuple(keys.T), tuple(keys.max(axis=0) + 1))
        order = np.lexsort((-self.areas_m2, flat))
        first = np.flatnonzero(np.diff(flat[order], prepend=-1))
        result: Indices = order[first]
        return result


def sample_surfaces(gaussian_map: GaussianMap, spacing_m: float) -> SurfacePoints:
    """Sample points on each opaque Gaussian, in the plane of its two long axes.

    Args:
        gaussian_map: The map.
        spacing_m: Maximum distance of neighbouring points of a Gaussian, m.

    Returns:
        The points.
    """
    opacities = 1 / (1 + np.exp(-gaussian_map.logit_opacities.astype(np.float64)))
    rows = np.flatnonzero(opacities >= MIN_OPACITY)
    means = gaussian_map.means[rows] + gaussian_map.origin
    scales = np.exp(gaussian_map.log_scales[rows].astype(np.float64))
    order = np.argsort(scales, axis=1)
    axes = axes_of(gaussian_map.quats[rows].astype(np.float64))
    number = np.arange(len(rows))
    sorted_scales = scales[number[:, None], order]
    areas_m2 = opacities[rows] * 2 * np.pi * sorted_scales[:, 1] * sorted_scales[:, 2]
    level = np.abs(axes[number, order[:, 0], 2]) >= MIN_LEVEL_COSINE
    steps = np.ceil(REACH_SIGMAS * sorted_scales[:, 1:] / spacing_m - 0.5)
    steps = steps.clip(0, MAX_STEPS).astype(np.intp)
    parts = []
    for first, second in np.unique(steps, axis=0):
        own = np.flatnonzero((steps == (first, second)).all(axis=1))
        long = axes[own, order[own, 2]] * sorted_scales[own, 2, None]
        wide = axes[own, order[own, 1]] * sorted_scales[own, 1, None]
        offsets = _ellipse_offsets(int(first), int(second))
        points = np.concatenate([means[own] + a * wide + b * long for a, b in offsets])
        count = len(offsets)
        parts.append((points, np.tile(own, count), np.full(len(points), 1 / count)))
    if not parts:
        empty = np.zeros(0)
        return SurfacePoints(np.zeros((0, 3)), rows, empty, empty, empty.astype(np.bool_))
    points, own, shares = (np.concatenate(column) for column in zip(*parts, strict=True))
    return SurfacePoints(points, rows[own], areas_m2[own] * shares, shares, level[own])


def floor_height_m(surfaces: SurfacePoints) -> float:
    """Compute the height of the floor: the lowest of the large horizontal layers.

    Args:
        surfaces: At least one point.

    Returns:
        World z, m.
    """
    z, areas_m2 = surfaces.points[:, 2], surfaces.areas_m2
    if surfaces.level.any():
        z, areas_m2 = z[surfaces.level], areas_m2[surfaces.level]
    kept = np.abs(z - np.median(z)) <= MAX_HEIGHT_M
    z, areas_m2 = z[kept], areas_m2[kept]
    bins = np.floor((z - z.min()) / FLOOR_BIN_M).astype(np.intp)
    layers = np.convolve(np.bincount(bins, areas_m2), np.ones(3), "same")
    lowest = int(np.flatnonzero(layers >= MIN_FLOOR_SHARE * layers.max())[0])
    peak = lowest + int(np.argmax(layers[lowest : lowest + 4]))  # From its foot to its maximum.
    near = np.abs(z - (z.min() + (peak + 0.5) * FLOOR_BIN_M)) <= 1.5 * FLOOR_BIN_M
    order = np.argsort(z[near])
    total = np.cumsum(areas_m2[near][order])
    return float(z[near][order][np.searchsorted(total, total[-1] / 2)])  # Weighted median.


def _ellipse_offsets(wide_steps: int, long_steps: int) -> list[tuple[float, float]]:
    """Return offsets along the two long axes, in standard deviations, within the reach."""
    return [
        (a, b)
        for a in _axis_offsets(wide_steps)
        for b in _axis_offsets(long_steps)
        if a**2 + b**2 <= REACH_SIGMAS**2
    ]


def _axis_offsets(steps: int) -> list[float]:
    return [REACH_SIGMAS * step / (steps + 0.5) for step in range(-steps, steps + 1)]
