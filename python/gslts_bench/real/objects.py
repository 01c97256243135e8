"""Objects of a map that stand on tables, shelves and floors, and free space beside them.

They are found without labels: what is connected above a horizontal plane, and touches nothing else.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from gslts.core.gaussian_map import GaussianMap
from gslts.types import Bools, Floats, Ints
from gslts_bench.real.planes import (
    CELL_M,
    MIN_NORMAL_COSINE,
    PLANE_M,
    Plane,
    SurfacePoints,
    cells_of,
    dilate,
    find_planes,
    is_in,
)

MIN_SIZE_M, MAX_SIZE_M = 0.05, 0.5
"""Limits of the largest extent of an object, m: a cup to a large box."""
MIN_CELLS = 12
"""Minimum number of cells of an object; fewer are noise."""
MIN_GAUSSIANS = 25
"""Minimum number of Gaussians of an object; fewer are a fragment of a surface."""
GROWTH, TOUCHING_M, MAX_TOUCHING = 3, 0.03, 0.1
"""An object takes in so often what is within so many m of its Gaussians. If it then still grows by
more than this share, it is a part of something."""
MAX_BASE_M = 0.05
"""Maximum distance of the lowest cell of an object from its plane, m."""
MIN_RING_SHARE = 0.3
"""Minimum share of the cells around an object that belong to its plane."""
MIN_SUPPORT_SHARE = 0.9
"""Minimum share of the cells of a place that belong to the plane."""
MIN_SHIFT_M, MAX_SHIFT_M = 0.15, 1.0
"""Limits of the distance to a free place, m. Less is a nudge; more leaves the view."""


@dataclass(frozen=True, eq=False)
class StandingObject:
    """Gaussians that stand on a plane.

    Attributes:
        rows: Rows of its Gaussians in the map.
        plane: The plane.
        cells: [K,2] cells of the plane below it, with a margin of one cell.
        height_m: Height above the plane, m.
    """

    rows: Ints
    plane: Plane
    cells: Ints
    height_m: float


def find_objects(
    gaussian_map: GaussianMap, surface: SurfacePoints, seed: int
) -> list[StandingObject]:
    """Find the objects of a map.

    Args:
        gaussian_map: The map.
        surface: Points of its surfaces.
        seed: Seed of the search for planes.

    Returns:
        Objects in an order that depends on the map and the seed alone.
    """
    means = gaussian_map.means + gaussian_map.origin
    points = surface.points
    rng = np.random.default_rng(seed)
    level = surface.normals @ surface.up > MIN_NORMAL_COSINE
    supports = find_planes(surface.select(level), rng)
    planes = [*supports, *find_planes(surface.select(~level), rng)]
    on_plane = np.zeros(len(points), np.bool_)
    for plane in planes:
        on_plane |= plane.rows_on(points, plane.cells)
    low = points.min(axis=0)
    cells = np.floor((means - low) / CELL_M).astype(np.int64)
    filled = np.zeros(np.floor((points.max(axis=0) - low) / CELL_M).astype(int) + 1, np.bool_)
    filled[tuple(np.floor((points[~on_plane] - low) / CELL_M).astype(np.int64).T)] = True
    labels, count = ndimage.label(filled, np.ones((3, 3, 3)))
    found = []
    for label, box in enumerate(ndimage.find_objects(labels, count), 1):
        extent_m = CELL_M * max(side.stop - side.start for side in box)
        if not MIN_SIZE_M <= extent_m <= MAX_SIZE_M:
            continue
        own = np.argwhere(labels[box] == label) + [side.start for side in box]
        if len(own) < MIN_CELLS:
            continue
        support = _support(low + CELL_M * (own + 0.5), supports)
        if support is not None:
            near = ndimage.binary_dilation(np.pad(labels[box] == label, 1), np.ones((3, 3, 3)))
            standing = _object(means, cells - [side.start - 1 for side in box], near, support)
            found += [standing] if standing is not None else []
    return found


def free_places(
    standing: StandingObject, points: Floats, rng: np.random.Generator
) -> Iterator[Ints]:
    """Yield steps (2,) to free places for an object on its plane, cells, in random order.

    Args:
        standing: The object.
        points: [P,3] points of all surfaces, world, m.
        rng: Decides the order.
    """
    plane = standing.plane
    local = plane.local(points)
    above = (local[:, 2] > PLANE_M) & (local[:, 2] < standing.height_m + MAX_BASE_M)
    blocked = cells_of(local[above])
    both = np.concatenate([plane.cells, blocked, standing.cells])
    reach = int(MAX_SHIFT_M / CELL_M)
    low = both.min(axis=0) - reach
    shape = both.max(axis=0) - low + reach + 1
    supported, taken = np.zeros(shape, np.bool_), np.zeros(shape, np.bool_)
    supported[tuple((plane.cells - low).T)] = True
    taken[tuple((blocked - low).T)] = True
    taken[tuple((standing.cells - low).T)] = True
    steps = np.stack(np.meshgrid(*2 * [np.arange(-reach, reach + 1)]), axis=2).reshape(-1, 2)
    distances_m = CELL_M * np.linalg.norm(steps, axis=1)
    steps = steps[(distances_m >= MIN_SHIFT_M) & (distances_m <= MAX_SHIFT_M)]
    for step in rng.permutation(steps):
        rows, columns = (standing.cells + step - low).T
        if not taken[rows, columns].any() and supported[rows, columns].mean() >= MIN_SUPPORT_SHARE:
            yield step


def _object(means: Floats, cells: Ints, near: Bools, plane: Plane) -> StandingObject | None:
    """Return the object of all Gaussians in some cells above a plane."""
    in_box = ((cells >= 0) & (cells < near.shape)).all(axis=1)
    rows = np.flatnonzero(in_box)
    rows = rows[near[tuple(cells[rows].T)]]
    rows = rows[plane.local(means[rows])[:, 2] > PLANE_M / 2]
    if len(rows) < MIN_GAUSSIANS:
        return None
    for _ in range(GROWTH):
        touching = _touching(means, rows, plane)
        rows = np.union1d(rows, touching)
    local = plane.local(means[rows])
    if np.ptp(local, axis=0).max() > MAX_SIZE_M or len(touching) > MAX_TOUCHING * len(rows):
        return None
    cells, height_m = cells_of(local), float(local[:, 2].max())
    inside = np.flatnonzero(plane.rows_on(means, cells, PLANE_M / 2, height_m))
    return StandingObject(np.union1d(rows, inside), plane, dilate(cells), height_m)


def _touching(means: Floats, rows: Ints, plane: Plane) -> Ints:
    """Return the rows above a plane that are near those of an object, and not among them."""
    distances_m, _ = cKDTree(means[rows]).query(means, distance_upper_bound=TOUCHING_M)
    near = np.isfinite(distances_m) & (plane.local(means)[:, 2] > 2 * PLANE_M)
    near[rows] = False
    return np.flatnonzero(near)


def _support(points: Floats, planes: Sequence[Plane]) -> Plane | None:
    """Return the plane that points [P,3] of an object stand on; None if there is none."""
    best, best_share = None, MIN_RING_SHARE
    for plane in planes:
        local = plane.local(points)
        if not -PLANE_M <= local[:, 2].min() <= MAX_BASE_M:
            continue
        inner = dilate(cells_of(local))
        ring = dilate(dilate(inner))
        ring = ring[~is_in(ring, inner)]
        share = float(is_in(ring, plane.cells).mean())
        if share >= best_share:
            best, best_share = plane, share
    return best
