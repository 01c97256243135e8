"""Seeds from points, for images without depth."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gslts.core.camera import Camera, unproject
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import SH_C0, GaussianMap
from gslts.core.se3 import inverse_transform
from gslts.datasets.dataset import PointCloud
from gslts.mapping.seeding.hole_seeds import fill_zeros
from gslts.types import Bools, Bytes, Floats, Ints

OPACITY = 0.3
"""Opacity of seeds. Positions are rough; more opaque seeds hide surfaces and stay as floaters."""
NEIGHBOURS = 3
"""Nearest points whose mean distance is the size of a Gaussian (Kerbl et al. 2023)."""
SCALE_RANGE_PX = (0.5, 20.0)
"""Range of the standard deviation in the image of the nearest camera that sees the point, px."""
CELLS_ACROSS = 32
"""Cells across the width of an image; a point is added in each without one, as on white walls."""
DEPTH_RANGE = (0.1, 3.0)
"""Depth of random points, relative to the extent of the cameras."""


def seed_from_points(
    cloud: PointCloud,
    frames: Sequence[RgbdFrame],
    sh_degree: int = 0,
    max_gaussians: int | None = None,
) -> GaussianMap:
    """Seed round Gaussians at points, and in image cells without points.

    Args:
        cloud: Points, such as of `triangulate`; a frame must see at least one.
        frames: Colours, masks and cameras; depth is not used.
        sh_degree: SH degree of the map; all but the constant coefficients are 0.
        max_gaussians: Maximum number of Gaussians; to meet it, points are left out evenly.

    Returns:
        float32 map.

    Raises:
        ValueError: No frame sees a point.
    """
    points, colors, nearest_m_per_px = _fill_cells(cloud, frames)
    if max_gaussians is not None and len(points) > max_gaussians:
        kept = np.linspace(0, len(points) - 1, max_gaussians).astype(np.int64)
        points, colors, nearest_m_per_px = points[kept], colors[kept], nearest_m_per_px[kept]
    low_m, high_m = (limit * nearest_m_per_px for limit in SCALE_RANGE_PX)
    scales_m = spacing(points).clip(low_m, high_m)
    size = len(points)
    sh = np.zeros((size, (sh_degree + 1) ** 2, 3), np.float32)
    sh[:, 0] = (colors / 255 - 0.5) / SH_C0
    return GaussianMap(
        means=points.astype(np.float32),
        quats=np.tile(np.array([1, 0, 0, 0], np.float32), (size, 1)),
        log_scales=np.log(scales_m).astype(np.float32)[:, None].repeat(3, axis=1),
        logit_opacities=np.full(size, np.log(OPACITY / (1 - OPACITY)), np.float32),
        sh=sh,
    )


def random_points_in_view(frames: Sequence[RgbdFrame], count: int, seed: int = 0) -> PointCloud:
    """Draw random points that at least two frames see, or one if there is only one.

    Args:
        frames: At least one.
        count: Number of points; fewer if few are seen twice.
        seed: Seed of the random generator.
    """
    rng = np.random.default_rng(seed)
    cameras = [frame.camera for frame in frames]
    centres = np.array([camera.world_from_camera[:3, 3] for camera in cameras])
    extent_m = 2 * float(np.linalg.norm(centres - centres.mean(axis=0), axis=1).max()) or 1.0
    each = -(-4 * count // len(frames))  # Four times as many as wanted: some are seen once only.
    points, colors = [], []
    for frame in frames:
        positions = rng.random((each, 2)) * (frame.camera.width, frame.camera.height)
        low, high = np.log(DEPTH_RANGE).tolist()
        depths_m = extent_m * np.exp(rng.uniform(low, high, each))
        points.append(unproject(frame.camera, positions, depths_m))
        colors.append(_colors(frame, positions))
        allowed = _allowed_cells(frame, positions)
        points[-1], colors[-1] = points[-1][allowed], colors[-1][allowed]
    several, shades = np.concatenate(points), np.concatenate(colors)
    seen = np.zeros(len(several), np.intp)
    for camera in cameras:
        seen += _project(camera, several)[2]
    kept = np.flatnonzero(seen >= min(2, len(frames)))
    kept = np.sort(rng.permutation(kept)[:count])
    return PointCloud(several[kept], shades[kept])


def spacing(points: Floats) -> Floats:
    """Return the mean distance [P] of each point to its nearest points.

    Args:
        points: [P,3]; for a single one the distance is infinite.
    """
    neighbours = min(NEIGHBOURS, len(points) - 1)
    if neighbours < 1:
        return np.full(len(points), np.inf)
    return np.asarray(np.sqrt(nearest(points, neighbours + 1)[1][:, 1:]).mean(axis=1), np.float64)


def nearest(points: Floats, count: int) -> tuple[Ints, Floats]:
    """Find the nearest points of each point; usually the first is the point itself.

    Args:
        points: [P,3].
        count: Number of nearest points.

    Returns:
        Rows [P,count] and squared distances [P,count].
    """
    import cv2

    near_zero = np.ascontiguousarray(points - points.mean(axis=0), np.float32)
    # FLANN_INDEX_KDTREE_SINGLE, which is exact.
    index = cv2.flann.Index(near_zero, {"algorithm": 4, "leaf_max_size": 12})
    rows, squares = index.knnSearch(near_zero, count, params={})
    return rows.astype(np.int64), squares.astype(np.float64)


def _fill_cells(cloud: PointCloud, frames: Sequence[RgbdFrame]) -> tuple[Floats, Bytes, Floats]:
    """Add points in empty cells; return points, colours, and m per px in the nearest image.

    Frames see the points that earlier frames added, so that a wall gets one layer of points and not
    one per frame.
    """
    points, colors = cloud.points, cloud.colors
    for frame in frames:
        camera = frame.camera
        cell_px = camera.width / CELLS_ACROSS
        shape = (max(1, round(camera.height / cell_px)), CELLS_ACROSS)
        positions, depths_m, seen = _project(camera, points)
        columns, rows = np.floor(positions[seen] / cell_px).astype(np.intp).T
        known = np.full(shape, np.inf)
        np.minimum.at(known, (rows.clip(0, shape[0] - 1), columns), depths_m[seen])
        empty = np.isinf(known)
        if empty.all() or not empty.any():
            continue
        known[empty] = 0
        rows, columns = np.nonzero(empty)
        middles = (np.column_stack([columns, rows]) + 0.5) * cell_px
        middles = np.minimum(middles, (camera.width - 0.5, camera.height - 0.5))
        allowed = _allowed_cells(frame, middles)
        new = unproject(camera, middles, fill_zeros(known)[empty])
        points = np.concatenate([points, new[allowed]])
        colors = np.concatenate([colors, _colors(frame, middles)[allowed]])
    nearest = np.full(len(points), np.inf)
    for frame in frames:
        _, depths_m, seen = _project(frame.camera, points)
        np.minimum(nearest, depths_m / frame.camera.fx, out=nearest, where=seen)
    some = np.isfinite(nearest)
    if not some.any():
        raise ValueError("seed_from_points: no frame sees a point")
    return points[some], colors[some], nearest[some]


def _project(camera: Camera, points: Floats) -> tuple[Floats, Floats, Bools]:
    """Return image positions [P,2] (px) and depths [P] (m) of points, and which are inside."""
    in_camera = inverse_transform(camera.world_from_camera, points)
    depths_m = in_camera[:, 2]
    ahead = np.where(depths_m > 0, depths_m, 1)[:, None]
    positions = in_camera[:, :2] / ahead * (camera.fx, camera.fy) + (camera.cx, camera.cy)
    inside = (positions >= 0).all(axis=1) & (positions < (camera.width, camera.height)).all(axis=1)
    return positions, depths_m, (depths_m > 0) & inside


def _at(positions: Floats) -> tuple[Ints, Ints]:
    columns, rows = np.floor(positions).astype(np.intp).T
    return rows, columns


def _colors(frame: RgbdFrame, positions: Floats) -> Bytes:
    return frame.rgb[_at(positions)]


def _allowed_cells(frame: RgbdFrame, positions: Floats) -> Bools:
    if frame.mask is None:
        return np.ones(len(positions), np.bool_)
    return frame.mask[_at(positions)]
