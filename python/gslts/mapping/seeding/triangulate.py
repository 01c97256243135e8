"""Triangulation of scene points from posed images without depth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gslts.core.camera import Camera
from gslts.core.frame import RgbdFrame
from gslts.datasets.dataset import PointCloud
from gslts.mapping.seeding.matching import build_tracks, choose_pairs, intrinsics, match
from gslts.mapping.seeding.sift import detect_keypoints
from gslts.types import Bools, Floats, Ints

TOLERANCE_PX = (1.0, 9.0)
"""Range of the tolerance of epipolar and reprojection errors, px: for exact poses, and at most."""
OUTLIER_FACTOR = 3.0
"""Tolerance relative to the median epipolar distance of all matches: more is an outlier."""
MIN_PARALLAX_RAD = np.deg2rad(1.5)
"""Minimum angle between rays of a point."""
MAX_RELATIVE_STD = 0.04
"""Maximum shift of a point for an error of one pixel, relative to its distance."""
STEPS = 3
"""Number of Gauss-Newton steps; they start near the solution, at the midpoint of the rays."""


def triangulate(frames: Sequence[RgbdFrame]) -> PointCloud:
    """Triangulate points that at least two frames see.

    The tolerance of reprojection errors follows from the epipolar errors of all matches, which show
    how far the poses are off.

    Args:
        frames: Images at roughly correct poses; depth is not used.

    Returns:
        Points and colours, possibly none, such as from images without texture; deterministic.

    Source: SIFT, Lowe 2004; structure from known poses, Hartley and Zisserman, Multiple View
    Geometry, chapter 12.
    """
    cameras = [frame.camera for frame in frames]
    keypoints = [detect_keypoints(frame) for frame in frames]
    matches = [match(pair, cameras, keypoints) for pair in choose_pairs(cameras)]
    errors_px = np.concatenate([np.zeros(1), *(found.distances_px for found in matches)])
    tolerance_px = float(np.clip(OUTLIER_FACTOR * np.median(errors_px), *TOLERANCE_PX))
    members = build_tracks([len(found.positions) for found in keypoints], matches, tolerance_px)
    if len(members) == 0:
        return PointCloud(np.zeros((0, 3)), np.zeros((0, 3), np.uint8))
    positions = np.array([keypoints[image].positions[row] for _, image, row in members])
    colors = np.array([keypoints[image].colors[row] for _, image, row in members])
    observed = _Observations.of(cameras, members[:, 1], positions, _starts(members[:, 0]))
    points, good = _solve(observed, tolerance_px)
    means = observed.sums(colors.astype(np.float64)) / observed.counts[:, None]
    return PointCloud(points[good], means[good].round().astype(np.uint8))


@dataclass(frozen=True, eq=False)
class _Observations:
    """K image positions of T points, ordered by points."""

    centres: Floats  # [K,3] of the cameras, m
    camera_from_world: Floats  # [K,3,3]
    intrinsics: Floats  # [K,3,3]
    positions: Floats  # [K,2] px
    starts: Ints  # [T] first row of each point

    @staticmethod
    def of(
        cameras: Sequence[Camera], images: Ints, positions: Floats, starts: Ints
    ) -> _Observations:
        poses = np.array([camera.world_from_camera for camera in cameras])[images]
        inside = np.array([intrinsics(camera) for camera in cameras])[images]
        turns = poses[:, :3, :3].transpose(0, 2, 1)
        return _Observations(poses[:, :3, 3], turns, inside, positions, starts)

    @property
    def counts(self) -> Ints:
        """Number [T] of observations of each point."""
        return np.diff(np.append(self.starts, len(self.positions)))

    def sums(self, values: Floats) -> Floats:
        """Return sums [T,...] of values [K,...] over the observations of each point."""
        result: Floats = np.add.reduceat(values, self.starts, axis=0)
        return result

    def directions(self) -> Floats:
        """Return unit vectors [K,3] in the world frame from the cameras to the points."""
        homogeneous = np.column_stack([self.positions, np.ones(len(self.positions))])[..., None]
        rays = np.linalg.inv(self.intrinsics) @ homogeneous
        in_world = (self.camera_from_world.transpose(0, 2, 1) @ rays)[..., 0]
        result: Floats = in_world / np.linalg.norm(in_world, axis=1, keepdims=True)
        return result

    def select(self, kept: Bools) -> _Observations:
        """Return some of the observations [K], of the points that keep any."""
        of_point = np.repeat(np.arange(len(self.starts)), self.counts)[kept]
        return _Observations(
            self.centres[kept],
            self.camera_from_world[kept],
            self.intrinsics[kept],
            self.positions[kept],
            _starts(of_point),
        )

    def project(self, points: Floats) -> tuple[Floats, Floats, Floats]:
        """Return errors [K,2] px, derivatives [K,2,3] px/m and depths [K] m of points [T,3]."""
        away = np.repeat(points, self.counts, axis=0) - self.centres
        in_camera = (self.camera_from_world @ away[..., None])[..., 0]
        depth = in_camera[:, 2]
        safe = np.where(np.abs(depth) > 1e-9, depth, 1e-9)[:, None]
        seen = (self.intrinsics @ (in_camera / safe)[..., None])[:, :2, 0]
        per_camera = self.intrinsics[:, :2].copy()
        per_camera[:, :, 2] -= seen
        jacobian = per_camera @ self.camera_from_world / safe[..., None]
        return seen - self.positions, jacobian, depth


def _solve(observed: _Observations, tolerance_px: float) -> tuple[Floats, Bools]:
    """Return points [T,3], and which of them [T] are accepted."""
    points = _least_squares(observed)
    # One wrong match must not cost a point that many images see.
    agree = np.linalg.norm(observed.project(points)[0], axis=1) <= tolerance_px
    good = observed.sums(agree.astype(np.float64)) >= 2
    kept = agree & np.repeat(good, observed.counts)
    if kept.any():
        observed = observed.select(kept)
        points[good] = _least_squares(observed)
        good[good] = _accept(observed, points[good], tolerance_px)
    return points, good


def _accept(observed: _Observations, points: Floats, tolerance_px: float) -> Bools:
    """Return which points [T] have small errors, enough parallax and a small covariance."""
    error, jacobian, depth = observed.project(points)
    fits = (np.linalg.norm(error, axis=1) <= tolerance_px) & (depth > 0)
    directions = observed.directions()
    middle = observed.sums(directions)
    middle /= np.linalg.norm(middle, axis=1, keepdims=True)
    cosines = (directions * np.repeat(middle, observed.counts, axis=0)).sum(axis=1)
    wide = np.minimum.reduceat(cosines, observed.starts) < np.cos(0.5 * MIN_PARALLAX_RAD)
    hessian = observed.sums(jacobian.transpose(0, 2, 1) @ jacobian)
    stiffness = np.linalg.eigvalsh(hessian)[:, 0]  # (px/m)^2 along the least certain direction
    nearest = np.minimum.reduceat(depth, observed.starts)
    sure = stiffness * (MAX_RELATIVE_STD * nearest) ** 2 > 1
    result: Bools = np.logical_and.reduceat(fits, observed.starts) & wide & sure
    return result


def _least_squares(observed: _Observations) -> Floats:
    """Return points [T,3] of least reprojection error, starting at the midpoints of the rays."""
    directions = observed.directions()
    across = np.eye(3) - directions[:, :, None] * directions[:, None]
    points = _solve_regularized(
        observed.sums(across), observed.sums(across @ observed.centres[..., None])
    )
    for _ in range(STEPS):
        error, jacobian, _ = observed.project(points)
        turned = jacobian.transpose(0, 2, 1)
        points -= _solve_regularized(
            observed.sums(turned @ jacobian), observed.sums(turned @ error[..., None])
        )
    return points


def _solve_regularized(matrices: Floats, right: Floats) -> Floats:
    """Solve systems [T,3,3] x = [T,3,1], slightly regularized for parallel rays."""
    small = 1e-9 * matrices.trace(axis1=1, axis2=2)
    solution = np.linalg.solve(matrices + small[:, None, None] * np.eye(3), right)
    return np.asarray(solution[..., 0], np.float64)


def _starts(numbers: Ints) -> Ints:
    """Return the rows at which ascending numbers change."""
    return np.flatnonzero(np.append(True, numbers[1:] != numbers[:-1]))
