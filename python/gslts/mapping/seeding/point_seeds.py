"""First Gaussians from points, for pictures without depth."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gslts.core.camera import Camera, unproject
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import SH_C0, GaussianMap
from gslts.core.se3 import inverse_transform
from gslts.datasets.dataset import PointCloud
from gslts.mapping.seeding.hole_seeds import interpolated
from gslts.types import Floats

OPACITY = 0.3
"""Places are rough: what is more opaque hides the surfaces and stays before them as fog."""
NEIGHBOURS = 3
"""Whose mean distance is the size of a Gaussian (Kerbl et al. 2023)."""
SCALE_RANGE_PX = (0.5, 20.0)
"""Of the standard deviation, as the nearest camera that sees the point sees it."""
CELLS_ACROSS = 32
"""Of a picture: where one has no point, as on white walls, one is added."""
DEPTH_RANGE = (0.1, 3.0)
"""Of points of which nothing is known, over the extent of the cameras."""


def seed_from_points(
    cloud: PointCloud,
    frames: Sequence[RgbdFrame],
    sh_degree: int = 0,
    most: int | None = None,
) -> GaussianMap:
    """Round Gaussians at the points, and where pictures have none.

    Args:
        cloud: Such as of `triangulated`; at least one point that a frame sees.
        frames: Their colours, masks and cameras are looked at.
        sh_degree: Of the map; all but the constant harmonic start at 0.
        most: If there would be more Gaussians, every so manieth point is left out.

    Raises:
        ValueError: No frame sees a point.
    """
    points, colors, nearest_m_per_px = _filled(cloud, frames)
    if most is not None and len(points) > most:
        kept = np.linspace(0, len(points) - 1, most).astype(np.int64)
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
    """Points at random places that at least two frames see, or one if there are no two.

    Args:
        frames: At least one.
        count: Of points; fewer if hardly any place is seen twice.
        seed: Of the random numbers.
    """
    rng = np.random.default_rng(seed)
    cameras = [frame.camera for frame in frames]
    centres = np.array([camera.world_from_camera[:3, 3] for camera in cameras])
    extent_m = 2 * float(np.linalg.norm(centres - centres.mean(axis=0), axis=1).max()) or 1.0
    each = -(-4 * count // len(frames))  # Four times as many as wanted: some are seen once.
    points, colors = [], []
    for frame in frames:
        places = rng.random((each, 2)) * (frame.camera.width, frame.camera.height)
        low, high = np.log(DEPTH_RANGE).tolist()
        depths_m = extent_m * np.exp(rng.uniform(low, high, each))
        points.append(unproject(frame.camera, places, depths_m))
        colors.append(_colors(frame, places))
        allowed = _allowed(frame, places)
        points[-1], colors[-1] = points[-1][allowed], colors[-1][allowed]
    several, shades = np.concatenate(points), np.concatenate(colors)
    seen = np.zeros(len(several), np.intp)
    for camera in cameras:
        seen += _seen(camera, several)[2]
    kept = np.flatnonzero(seen >= min(2, len(frames)))
    kept = np.sort(rng.permutation(kept)[:count])
    return PointCloud(several[kept], shades[kept])


def spacing(points: Floats) -> Floats:
    """[P] m, mean distance of each point [P,3] to the next ones; infinite for a single one."""
    neighbours = min(NEIGHBOURS, len(points) - 1)
    if neighbours < 1:
        return np.full(len(points), np.inf)
    return np.asarray(np.sqrt(nearest(points, neighbours + 1)[1][:, 1:]).mean(axis=1), np.float64)


def nearest(points: Floats, count: int) -> tuple[NDArray[np.int64], Floats]:
    """[P,count] the points [P,3] nearest to each, mostly itself first, and squared distances."""
    import cv2

    near_zero = np.ascontiguousarray(points - points.mean(axis=0), np.float32)
    # FLANN_INDEX_KDTREE_SINGLE, which is exact.
    index = cv2.flann.Index(near_zero, {"algorithm": 4, "leaf_max_size": 12})
    rows, squares = index.knnSearch(near_zero, count, params={})
    return rows.astype(np.int64), squares.astype(np.float64)


def _filled(
    cloud: PointCloud, frames: Sequence[RgbdFrame]
) -> tuple[Floats, NDArray[np.uint8], Floats]:
    """Points and colours, with those added for empty cells; and m per px in the nearest picture.

    What one frame adds the next ones know, so that a wall gets one layer of points and not one for
    each frame.
    """
    points, colors = cloud.points, cloud.colors
    for frame in frames:
        camera = frame.camera
        cell_px = camera.width / CELLS_ACROSS
        shape = (max(1, round(camera.height / cell_px)), CELLS_ACROSS)
        places, depths_m, seen = _seen(camera, points)
        columns, rows = np.floor(places[seen] / cell_px).astype(np.intp).T
        known = np.full(shape, np.inf)
        np.minimum.at(known, (rows.clip(0, shape[0] - 1), columns), depths_m[seen])
        empty = np.isinf(known)
        if empty.all() or not empty.any():
            continue
        known[empty] = 0
        rows, columns = np.nonzero(empty)
        middles = (np.column_stack([columns, rows]) + 0.5) * cell_px
        middles = np.minimum(middles, (camera.width - 0.5, camera.height - 0.5))
        allowed = _allowed(frame, middles)
        new = unproject(camera, middles, interpolated(known)[empty])
        points = np.concatenate([points, new[allowed]])
        colors = np.concatenate([colors, _colors(frame, middles)[allowed]])
    nearest = np.full(len(points), np.inf)
    for frame in frames:
        _, depths_m, seen = _seen(frame.camera, points)
        np.minimum(nearest, depths_m / frame.camera.fx, out=nearest, where=seen)
    some = np.isfinite(nearest)
    if not some.any():
        raise ValueError("seed_from_points: no frame sees a point")
    return points[some], colors[some], nearest[some]


def _seen(camera: Camera, points: Floats) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Where points [P,3] are in a picture [P,2], px, their depths [P], m, and whether they are."""
    in_camera = inverse_transform(camera.world_from_camera, points)
    depths_m = in_camera[:, 2]
    ahead = np.where(depths_m > 0, depths_m, 1)[:, None]
    places = in_camera[:, :2] / ahead * (camera.fx, camera.fy) + (camera.cx, camera.cy)
    inside = (places >= 0).all(axis=1) & (places < (camera.width, camera.height)).all(axis=1)
    return places, depths_m, (depths_m > 0) & inside


def _at(places: Floats) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    columns, rows = np.floor(places).astype(np.intp).T
    return rows, columns


def _colors(frame: RgbdFrame, places: Floats) -> NDArray[np.uint8]:
    return frame.rgb[_at(places)]


def _allowed(frame: RgbdFrame, places: Floats) -> NDArray[np.bool_]:
    if frame.mask is None:
        return np.ones(len(places), np.bool_)
    return frame.mask[_at(places)]
