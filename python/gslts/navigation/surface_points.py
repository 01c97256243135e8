"""Points on the surfaces that Gaussians stand for."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gslts.core.gaussian_map import GaussianMap
from gslts.mapping.density.control import axes_of
from gslts.types import Floats

LEAST_OPACITY = 0.3
REACH = 1.5
"""Standard deviations to each side that count as the surface of a Gaussian."""
MOST_STEPS = 4
"""Points to each side along an axis, at most; larger Gaussians are of windows and skies."""
MOST_HEIGHT_M = 100.0
FLOOR_BIN_M = 0.02
FLOOR_SHARE = 0.3
"""Area of a horizontal layer over that of the largest, from which on it may be the floor."""
LEVEL = 0.8
"""Cosine of the angle to the vertical below which a surface counts as horizontal."""
DENSE_M, DENSE_POINTS = 0.25, 30
"""A square with so many points is part of the home, and no stray Gaussian."""


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """Points on the opaque Gaussians of a map.

    Attributes:
        points: [P,3] in the world, m.
        rows: [P] of the Gaussian of each in the map.
        areas_m2: [P] opaque area that each stands for.
        shares: [P] part of its Gaussian that each is; those of a Gaussian sum up to 1.
        level: [P] whether the surface is horizontal.
    """

    points: Floats
    rows: NDArray[np.intp]
    areas_m2: Floats
    shares: Floats
    level: NDArray[np.bool_]

    def extent(self, cell_m: float) -> tuple[Floats, Floats]:
        """(2,) least and greatest x and y, m, of squares with all points but stray ones."""
        edge_m = max(DENSE_M, cell_m)
        squares = np.floor(self.points[:, :2] / edge_m).astype(np.int64)
        first = squares.min(axis=0)
        width = int(squares[:, 1].max() - first[1]) + 1
        keys = (squares[:, 0] - first[0]) * width + squares[:, 1] - first[1]
        found, counts = np.unique(keys, return_counts=True)
        dense = found[counts >= min(DENSE_POINTS, counts.max())]
        own = first + np.stack([dense // width, dense % width], axis=1)
        return own.min(axis=0) * edge_m, (own.max(axis=0) + 1) * edge_m

    def most_of_voxels(self, edge_m: float) -> NDArray[np.intp]:
        """[V] the point with the greatest area in each voxel."""
        keys = np.floor(self.points / edge_m).astype(np.int64)
        keys -= keys.min(axis=0)
        flat = np.ravel_multi_index(tuple(keys.T), tuple(keys.max(axis=0) + 1))
        order = np.lexsort((-self.areas_m2, flat))
        first = np.flatnonzero(np.diff(flat[order], prepend=-1))
        result: NDArray[np.intp] = order[first]
        return result


def sample_surfaces(gaussian_map: GaussianMap, apart_m: float) -> SurfacePoints:
    """Points on each opaque Gaussian, no farther apart than a length along its two long axes.

    Args:
        gaussian_map: The map.
        apart_m: The length.
    """
    opacities = 1 / (1 + np.exp(-gaussian_map.logit_opacities.astype(np.float64)))
    rows = np.flatnonzero(opacities >= LEAST_OPACITY)
    means = gaussian_map.means[rows] + gaussian_map.origin
    scales = np.exp(gaussian_map.log_scales[rows].astype(np.float64))
    order = np.argsort(scales, axis=1)
    axes = axes_of(gaussian_map.quats[rows].astype(np.float64))
    number = np.arange(len(rows))
    reaches = scales[number[:, None], order]
    areas_m2 = opacities[rows] * 2 * np.pi * reaches[:, 1] * reaches[:, 2]
    level = np.abs(axes[number, order[:, 0], 2]) >= LEVEL
    steps = np.ceil(REACH * reaches[:, 1:] / apart_m - 0.5).clip(0, MOST_STEPS).astype(np.intp)
    parts = []
    for first, second in np.unique(steps, axis=0):
        own = np.flatnonzero((steps == (first, second)).all(axis=1))
        long = axes[own, order[own, 2]] * reaches[own, 2, None]
        wide = axes[own, order[own, 1]] * reaches[own, 1, None]
        offsets = [
            (a, b)
            for a in _spread(int(first))
            for b in _spread(int(second))
            if a**2 + b**2 <= REACH**2
        ]
        points = np.concatenate([means[own] + a * wide + b * long for a, b in offsets])
        count = len(offsets)
        parts.append((points, np.tile(own, count), np.full(len(points), 1 / count)))
    if not parts:
        none = np.zeros(0)
        return SurfacePoints(np.zeros((0, 3)), rows, none, none, none.astype(np.bool_))
    points, own, shares = (np.concatenate(column) for column in zip(*parts, strict=True))
    return SurfacePoints(points, rows[own], areas_m2[own] * shares, shares, level[own])


def floor_height_m(points: SurfacePoints) -> float:
    """Height of the lowest of the large horizontal layers, world z, m.

    Args:
        points: At least one.
    """
    z, areas_m2 = points.points[:, 2], points.areas_m2
    if points.level.any():
        z, areas_m2 = z[points.level], areas_m2[points.level]
    kept = np.abs(z - np.median(z)) <= MOST_HEIGHT_M  # A stray Gaussian may be anywhere.
    z, areas_m2 = z[kept], areas_m2[kept]
    numbers = np.floor((z - z.min()) / FLOOR_BIN_M).astype(np.intp)
    layers = np.convolve(np.bincount(numbers, areas_m2), np.ones(3), "same")
    lowest = int(np.flatnonzero(layers >= FLOOR_SHARE * layers.max())[0])
    peak = lowest + int(np.argmax(layers[lowest : lowest + 4]))  # From its foot to its middle.
    near = np.abs(z - (z.min() + (peak + 0.5) * FLOOR_BIN_M)) <= 1.5 * FLOOR_BIN_M
    order = np.argsort(z[near])
    total = np.cumsum(areas_m2[near][order])
    return float(z[near][order][np.searchsorted(total, total[-1] / 2)])


def _spread(steps: int) -> list[float]:
    """Offsets along an axis, in standard deviations."""
    return [REACH * step / (steps + 0.5) for step in range(-steps, steps + 1)]
