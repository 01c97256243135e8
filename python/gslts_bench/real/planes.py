"""Planes of a map, and points of its surfaces."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from gslts.core.camera import Camera, downscale, unproject
from gslts.core.gaussian_map import GaussianMap
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.trajectory.upright import up_of
from gslts.types import Bools, Floats, Ints

CELL_M = 0.02
"""Edge of the cells in which points are connected, m; about the spacing of surface Gaussians."""
PLANE_M = 0.02
"""Maximum distance of the points of a plane, m: about the error of a map from Kinect depth."""
MIN_PLANE_M2 = 0.1
"""Minimum area of a plane, m^2: a small table."""
MAX_PLANES, HYPOTHESES, SAMPLED = 8, 400, 20_000
"""Maximum number of level and of other planes, and random hypotheses and points to find each."""
NORMAL_M = 0.1
"""Radius of the neighbourhood that gives the normal of a hypothesis, m."""
MIN_NORMAL_COSINE = 0.85
"""Minimum cosine of the normals of a point and of its plane: points of objects that a plane crosses
do not count."""
MIN_POINTS = 12
"""Minimum number of points of a plane."""
WIDTH_PX = 320
"""Width of the images that surface points come from: a pixel is about 0.7 cm at 2 m."""
MIN_ALPHA, MAX_JUMP = 0.9, 0.05
"""Minimum alpha of a pixel that shows a surface, and maximum difference of the depths around it,
relative to the depth: between an object and what is behind it, rendered depth is neither's."""
SPACING_M = 0.01
"""Minimum spacing of surface points, m."""


@dataclass(frozen=True, eq=False)
class SurfacePoints:
    """Points of the surfaces of a map.

    Attributes:
        points: [P,3] world, m.
        normals: [P,3] unit vectors, towards the cameras.
        up: (3,) unit vector, upwards.
    """

    points: Floats
    normals: Floats
    up: Floats

    def select(self, chosen: Bools) -> SurfacePoints:
        """Return some of the points.

        Args:
            chosen: [P] bool.
        """
        return SurfacePoints(self.points[chosen], self.normals[chosen], self.up)


@dataclass(frozen=True, eq=False)
class Plane:
    """A plane of the map with axes of its own: two in it and the normal, towards the cameras.

    Attributes:
        axes: [3,3] unit vectors as rows, the normal last, world.
        height_m: Height of the plane along the normal, m.
        cells: [K,2] cells of its points, multiples of `CELL_M` along the first two axes.
    """

    axes: Floats
    height_m: float
    cells: Ints

    def local(self, points: Floats) -> Floats:
        """Return points [P,3] of the world in the axes of the plane; the last is the height, m.

        Args:
            points: [P,3] world, m.
        """
        return points @ self.axes.T - (0.0, 0.0, self.height_m)

    def shift(self, step: Ints) -> Floats:
        """Return the shift (3,) in the world by a step (2,) in cells of the plane, m.

        Args:
            step: (2,) along the first two axes, cells.
        """
        return np.asarray(CELL_M * step @ self.axes[:2])

    def rows_on(
        self, points: Floats, cells: Ints, low_m: float = -PLANE_M, high_m: float = PLANE_M
    ) -> Bools:
        """Return which points [P] are in some cells at some height, by default on the plane.

        Args:
            points: [P,3] world, m.
            cells: [K,2] cells of the plane.
            low_m: Minimum height above the plane, m.
            high_m: Maximum height above the plane, m.
        """
        local = self.local(points)
        height_m = local[:, 2]
        return (height_m > low_m) & (height_m < high_m) & is_in(_cell_of(local), cells)


def surface_points(gaussian_map: GaussianMap, cameras: Sequence[Camera]) -> SurfacePoints:
    """Return points of the surfaces that cameras see in a map.

    Args:
        gaussian_map: The map, float32.
        cameras: At least one.
    """
    rasterizer = Rasterizer(np.float32)
    found = []
    for camera in cameras:
        small = downscale(camera, max(1, camera.width // WIDTH_PX))
        images = rasterizer.forward(gaussian_map, small, RenderOptions(threads=1))
        depth: Floats = images.depth.astype(np.float64)
        jump = ndimage.maximum_filter(depth, 3) - ndimage.minimum_filter(depth, 3)
        seen = (images.alpha > MIN_ALPHA) & (jump < MAX_JUMP * depth)
        rows, columns = np.indices(depth.shape)
        pixels = (np.stack([columns, rows], axis=2).reshape(-1, 2) + 0.5).astype(np.float64)
        points = unproject(small, pixels, depth.ravel()).reshape(*depth.shape, 3)
        down, right = np.gradient(points, axis=(0, 1))
        normals = np.cross(down, right)  # Columns grow to the right, rows down: towards the camera.
        normals /= np.linalg.norm(normals, axis=2, keepdims=True) + 1e-12
        found.append(np.concatenate([points[seen], normals[seen]], axis=1))
    every = np.concatenate(found)
    cells = np.floor(every[:, :3] / SPACING_M).astype(np.int64)
    _, first = np.unique(cells, axis=0, return_index=True)
    chosen = every[np.sort(first)]
    up = up_of(np.array([camera.world_from_camera for camera in cameras]))
    return SurfacePoints(chosen[:, :3], chosen[:, 3:], up)


def find_planes(surface: SurfacePoints, rng: np.random.Generator) -> list[Plane]:
    """Find planes by RANSAC, each in the points that no earlier one explains.

    Args:
        surface: Points of surfaces.
        rng: Draws the hypotheses.
    """
    left, normals = surface.points, surface.normals
    planes = []
    for _ in range(MAX_PLANES):
        some = rng.permutation(len(left))[:SAMPLED]
        if len(some) < MIN_POINTS:
            break
        normal, height_m = _best_plane(left[some], normals[some], rng)
        on_it = _near(left, normals, normal, height_m)
        first = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
        first /= np.linalg.norm(first)
        axes = np.stack([first, np.cross(normal, first), normal])
        if on_it.sum() < MIN_POINTS:
            break
        cells = _close_gaps(cells_of(left[on_it] @ axes.T))
        left, normals = left[~on_it], normals[~on_it]
        if len(cells) * CELL_M**2 >= MIN_PLANE_M2:
            planes.append(Plane(axes, height_m, cells))
    return planes


def cells_of(local: Floats) -> Ints:
    """Return the distinct cells [K,2] of points.

    Args:
        local: [P,3] in the axes of a plane, m.
    """
    return np.unique(_cell_of(local), axis=0)


def is_in(cells: Ints, others: Ints) -> Bools:
    """Return which cells are among others.

    Args:
        cells: [K,2].
        others: [L,2].

    Returns:
        [K] bool.
    """
    return np.asarray(np.isin(_keys(cells), _keys(others)))


def dilate(cells: Ints) -> Ints:
    """Return cells with their eight neighbours.

    Args:
        cells: [K,2].
    """
    return _apply_morphology(cells, ndimage.binary_dilation)


def _best_plane(points: Floats, normals: Floats, rng: np.random.Generator) -> tuple[Floats, float]:
    """Return normal and height of the plane with most points near it."""
    best, count = (normals[0], float(points[0] @ normals[0])), -1
    for start in rng.integers(len(points), size=HYPOTHESES):
        near = np.linalg.norm(points - points[start], axis=1) < NORMAL_M
        normal = np.median(normals[near], axis=0)
        normal /= np.linalg.norm(normal) + 1e-12
        plane = normal, float(np.median(points[near] @ normal))
        near_it = int(_near(points, normals, *plane).sum())
        if near_it > count:
            best, count = plane, near_it
    for _ in range(3):
        inliers = points[_near(points, normals, *best)]
        if len(inliers) < MIN_POINTS:
            break
        middle = inliers.mean(axis=0)
        normal = np.linalg.eigh(np.cov((inliers - middle).T))[1][:, 0]
        normal = normal if normal @ best[0] > 0 else -normal
        best = normal, float(middle @ normal)
    return best


def _near(points: Floats, normals: Floats, normal: Floats, height_m: float) -> Bools:
    """Return which points [P] lie on a plane, and face as it does."""
    close = np.abs(points @ normal - height_m) < PLANE_M
    return np.asarray(close & (normals @ normal > MIN_NORMAL_COSINE))


def _close_gaps(cells: Ints) -> Ints:
    """Return cells with the gaps between them closed."""
    return _apply_morphology(cells, ndimage.binary_closing)


def _apply_morphology(cells: Ints, change: Callable[..., Bools]) -> Ints:
    low = cells.min(axis=0) - 2
    image = np.zeros(cells.max(axis=0) - low + 3, np.bool_)
    image[tuple((cells - low).T)] = True
    return np.asarray(np.argwhere(change(image, np.ones((3, 3)))) + low)


def _cell_of(local: Floats) -> Ints:
    """Return the cell [P,2] of each point in the axes of a plane."""
    return np.floor(local[:, :2] / CELL_M).astype(np.int64)


def _keys(cells: Ints) -> Ints:
    """Return one number [K] per cell; rooms are smaller than 2^20 cells."""
    return cells[:, 0] * (1 << 20) + cells[:, 1]
