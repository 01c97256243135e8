"""Points of the scene from posed pictures without depth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gslts.core.camera import Camera
from gslts.core.frame import RgbdFrame
from gslts.datasets.dataset import PointCloud
from gslts.mapping.seeding.matching import Integers, intrinsics, matched, pairs, tracks
from gslts.mapping.seeding.sift import features
from gslts.types import Floats

TOLERANCE_PX = (1.0, 9.0)
"""Of epipolar and reprojection errors: where the poses are right, and at most."""
OUTLIERS = 3.0
"""Times the median error of the matches: what is farther off is wrong, not just imprecise."""
LEAST_PARALLAX_RAD = np.deg2rad(1.5)
"""Between the rays of a point."""
UNCERTAINTY = 0.04
"""Of the distance of a point, that it may move by where the pictures move by a pixel."""
STEPS = 3
"""Of Gauss and Newton; the midpoint that they start from is near."""


def triangulated(frames: Sequence[RgbdFrame]) -> PointCloud:
    """Points that several of the frames see; deterministic.

    Args:
        frames: With poses that are roughly right; their depth is not looked at. How far the poses
            are off is told by the matches, and so many px a point may be off.

    Returns:
        Maybe nothing, as from pictures without texture.

    Source: SIFT, Lowe 2004; structure from known poses, Hartley and Zisserman, Multiple View
    Geometry, chapter 12.
    """
    cameras = [frame.camera for frame in frames]
    found = [features(frame) for frame in frames]
    matches = [matched(pair, cameras, found) for pair in pairs(cameras)]
    errors_px = np.concatenate([np.zeros(1), *(one.distances_px for one in matches)])
    tolerance_px = float(np.clip(OUTLIERS * np.median(errors_px), *TOLERANCE_PX))
    members = tracks([len(one.places) for one in found], matches, tolerance_px)
    if len(members) == 0:
        return PointCloud(np.zeros((0, 3)), np.zeros((0, 3), np.uint8))
    places = np.array([found[picture].places[row] for _, picture, row in members])
    colors = np.array([found[picture].colors[row] for _, picture, row in members])
    sights = _Sights.of(cameras, members[:, 1], places, _starts(members[:, 0]))
    points, good = _solved(sights, tolerance_px)
    means = sights.sums(colors.astype(np.float64)) / sights.counts[:, None]
    return PointCloud(points[good], means[good].round().astype(np.uint8))


@dataclass(frozen=True, eq=False)
class _Sights:
    """K places in pictures where one of T points each was seen, ordered by points."""

    centres: Floats  # [K,3] of the cameras, m
    camera_from_world: Floats  # [K,3,3]
    intrinsics: Floats  # [K,3,3]
    places: Floats  # [K,2] px
    starts: Integers  # [T] the first of each point

    @staticmethod
    def of(
        cameras: Sequence[Camera], pictures: Integers, places: Floats, starts: Integers
    ) -> _Sights:
        poses = np.array([camera.world_from_camera for camera in cameras])[pictures]
        inside = np.array([intrinsics(camera) for camera in cameras])[pictures]
        turns = poses[:, :3, :3].transpose(0, 2, 1)
        return _Sights(poses[:, :3, 3], turns, inside, places, starts)

    @property
    def counts(self) -> Integers:
        """[T] of each point."""
        return np.diff(np.append(self.starts, len(self.places)))

    def sums(self, values: Floats) -> Floats:
        """[T,...] over the sights of each point, of [K,...]."""
        result: Floats = np.add.reduceat(values, self.starts, axis=0)
        return result

    def directions(self) -> Floats:
        """[K,3] unit vectors in the world from the cameras to the points."""
        homogeneous = np.column_stack([self.places, np.ones(len(self.places))])[..., None]
        rays = np.linalg.inv(self.intrinsics) @ homogeneous
        in_world = (self.camera_from_world.transpose(0, 2, 1) @ rays)[..., 0]
        result: Floats = in_world / np.linalg.norm(in_world, axis=1, keepdims=True)
        return result

    def selected(self, kept: NDArray[np.bool_]) -> _Sights:
        """Some of the sights [K], of the points that keep any."""
        of_point = np.repeat(np.arange(len(self.starts)), self.counts)[kept]
        return _Sights(
            self.centres[kept],
            self.camera_from_world[kept],
            self.intrinsics[kept],
            self.places[kept],
            _starts(of_point),
        )

    def projected(self, points: Floats) -> tuple[Floats, Floats, Floats]:
        """Of points [T,3]: errors [K,2], px; their derivatives [K,2,3], px/m; depths [K], m."""
        away = np.repeat(points, self.counts, axis=0) - self.centres
        in_camera = (self.camera_from_world @ away[..., None])[..., 0]
        depth = in_camera[:, 2]
        safe = np.where(np.abs(depth) > 1e-9, depth, 1e-9)[:, None]
        seen = (self.intrinsics @ (in_camera / safe)[..., None])[:, :2, 0]
        per_camera = self.intrinsics[:, :2].copy()
        per_camera[:, :, 2] -= seen
        jacobian = per_camera @ self.camera_from_world / safe[..., None]
        return seen - self.places, jacobian, depth


def _solved(sights: _Sights, tolerance_px: float) -> tuple[Floats, NDArray[np.bool_]]:
    """Points [T,3], and which of them [T] are good."""
    points = _least_squares(sights)
    # One wrong match must not cost a point that many pictures see.
    agree = np.linalg.norm(sights.projected(points)[0], axis=1) <= tolerance_px
    good = sights.sums(agree.astype(np.float64)) >= 2
    kept = agree & np.repeat(good, sights.counts)
    if kept.any():
        sights = sights.selected(kept)
        points[good] = _least_squares(sights)
        good[good] = _trusted(sights, points[good], tolerance_px)
    return points, good


def _trusted(sights: _Sights, points: Floats, tolerance_px: float) -> NDArray[np.bool_]:
    """[T] whether all sights agree on a point, and from places apart."""
    error, jacobian, depth = sights.projected(points)
    fits = (np.linalg.norm(error, axis=1) <= tolerance_px) & (depth > 0)
    directions = sights.directions()
    middle = sights.sums(directions)
    middle /= np.linalg.norm(middle, axis=1, keepdims=True)
    cosines = (directions * np.repeat(middle, sights.counts, axis=0)).sum(axis=1)
    wide = np.minimum.reduceat(cosines, sights.starts) < np.cos(0.5 * LEAST_PARALLAX_RAD)
    hessian = sights.sums(jacobian.transpose(0, 2, 1) @ jacobian)
    stiffness = np.linalg.eigvalsh(hessian)[:, 0]  # (px/m)^2 in the direction least certain
    nearest = np.minimum.reduceat(depth, sights.starts)
    sure = stiffness * (UNCERTAINTY * nearest) ** 2 > 1
    result: NDArray[np.bool_] = np.logical_and.reduceat(fits, sights.starts) & wide & sure
    return result


def _least_squares(sights: _Sights) -> Floats:
    """[T,3] of least reprojection errors, from the points nearest to the rays."""
    directions = sights.directions()
    across = np.eye(3) - directions[:, :, None] * directions[:, None]
    points = _solution(sights.sums(across), sights.sums(across @ sights.centres[..., None]))
    for _ in range(STEPS):
        error, jacobian, _ = sights.projected(points)
        turned = jacobian.transpose(0, 2, 1)
        points -= _solution(sights.sums(turned @ jacobian), sights.sums(turned @ error[..., None]))
    return points


def _solution(matrices: Floats, right: Floats) -> Floats:
    """[T,3] of [T,3,3] and [T,3,1]; with so little added that parallel rays have one, too."""
    small = 1e-9 * matrices.trace(axis1=1, axis2=2)
    solution = np.linalg.solve(matrices + small[:, None, None] * np.eye(3), right)
    return np.asarray(solution[..., 0], np.float64)


def _starts(numbers: Integers) -> Integers:
    """Where the numbers, which ascend, change."""
    return np.flatnonzero(np.append(True, numbers[1:] != numbers[:-1]))
