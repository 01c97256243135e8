"""Matching of keypoints between posed images, and tracks of them over all images."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gslts.core.camera import Camera
from gslts.mapping.seeding.sift import Keypoints
from gslts.types import Floats, Ints

PARTNERS = 8
"""Number of images that each one is matched with; the time of matching is proportional to it."""
MAX_VIEW_ANGLE_RAD = np.deg2rad(45)
"""Maximum angle between viewing directions of a pair; beyond, SIFT matches little."""
MIN_BASELINE_SHARE = 1e-3
"""Minimum distance of a pair, relative to the median distance between cameras."""
MAX_RATIO = 0.8
"""Maximum ratio of the distances to the best and second-best descriptor (Lowe 2004)."""
MAX_EPIPOLAR_PX = 12.0
"""Maximum distance from the epipolar line, px. A pose off by 1 cm and 0.5 degrees moves it 7 px."""


@dataclass(frozen=True, eq=False)
class Matches:
    """Matched keypoints of two images that agree with the poses.

    Attributes:
        pair: Indices of the images.
        rows: [M,2] rows of the keypoints in each.
        distances_px: [M] distances from the epipolar line in the second image, px.
    """

    pair: tuple[int, int]
    rows: Ints
    distances_px: Floats


def choose_pairs(cameras: Sequence[Camera]) -> list[tuple[int, int]]:
    """Choose pairs of cameras that may see the same surface across a baseline.

    As the scale is unknown, and cameras may be dense or sparse, the partners of each camera are at
    geometrically growing ranks of distance among those with a similar viewing direction.

    Args:
        cameras: Cameras of all images.

    Returns:
        Pairs of indices (i, j), i < j, ascending.
    """
    if len(cameras) < 2:
        return []
    centres = np.array([camera.world_from_camera[:3, 3] for camera in cameras])
    views = np.array([camera.world_from_camera[:3, 2] for camera in cameras])
    alike = views @ views.T > np.cos(MAX_VIEW_ANGLE_RAD)
    apart = np.linalg.norm(centres[:, None] - centres, axis=2)
    alike &= apart > MIN_BASELINE_SHARE * np.median(apart)
    found = set()
    for i in range(len(cameras)):
        partners = np.flatnonzero(alike[i])
        partners = partners[np.argsort(apart[i, partners], kind="stable")]
        if len(partners) == 0:
            continue
        ladder = np.geomspace(1, len(partners), PARTNERS).round().astype(int) - 1
        found |= {(min(i, j), max(i, j)) for j in partners[ladder].tolist()}
    return sorted(found)


def match(
    pair: tuple[int, int], cameras: Sequence[Camera], keypoints: Sequence[Keypoints]
) -> Matches:
    """Match the keypoints of two images: mutual nearest, ratio test, epipolar distance.

    Args:
        pair: Indices of the images.
        cameras: Cameras of all images.
        keypoints: Keypoints of all images.
    """
    first, second = (keypoints[row] for row in pair)
    if len(first.positions) < 2 or len(second.positions) < 2:
        return Matches(pair, np.zeros((0, 2), np.intp), np.zeros(0))
    a, b = first.descriptors, second.descriptors
    unlike = a @ (-2 * b).T
    unlike += (a**2).sum(axis=1)[:, None]
    unlike += (b**2).sum(axis=1)
    i, best = np.arange(len(a)), unlike.argmin(axis=1)
    least = unlike[i, best]
    good = least == unlike.min(axis=0)[best]
    unlike[i, best] = np.inf
    good &= least < MAX_RATIO**2 * unlike.min(axis=1)
    rows = np.column_stack([i, best])[good]
    distances_px = _epipolar_distances_px(
        cameras[pair[0]],
        cameras[pair[1]],
        first.positions[rows[:, 0]],
        second.positions[rows[:, 1]],
    )
    near = distances_px <= MAX_EPIPOLAR_PX
    return Matches(pair, rows[near], distances_px[near])


def _epipolar_distances_px(
    first: Camera, second: Camera, in_first: Floats, in_second: Floats
) -> Floats:
    """Return distances [M] of points [M,2] in the second image from the lines of the first."""
    second_from_first = np.linalg.inv(second.world_from_camera) @ first.world_from_camera
    x, y, z = second_from_first[:3, 3]
    across = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    essential = across @ second_from_first[:3, :3]
    fundamental = np.linalg.inv(intrinsics(second)).T @ essential @ np.linalg.inv(intrinsics(first))
    lines = np.column_stack([in_first, np.ones(len(in_first))]) @ fundamental.T
    away = np.abs((lines[:, :2] * in_second).sum(axis=1) + lines[:, 2])
    away_px: Floats = away / np.maximum(np.linalg.norm(lines[:, :2], axis=1), 1e-12)
    return away_px


def intrinsics(camera: Camera) -> Floats:
    """Return the intrinsic matrix [3,3], from the camera frame to homogeneous px.

    Args:
        camera: Any camera.
    """
    return np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])


def build_tracks(sizes: Sequence[int], matches: Sequence[Matches], tolerance_px: float) -> Ints:
    """Join matches into tracks: keypoints of one point of the scene over all images.

    Args:
        sizes: Numbers of keypoints of the images.
        matches: Matches of all pairs.
        tolerance_px: Maximum distance from the epipolar line, px.

    Returns:
        [K,3] track, image, keypoint, ascending; each track in at least two images. If a track has
        several keypoints in an image, these are left out.
    """
    firsts = np.concatenate([[0], np.cumsum(sizes)])
    parents = list(range(int(firsts[-1])))

    def root(node: int) -> int:
        while parents[node] != node:
            parents[node] = parents[parents[node]]
            node = parents[node]
        return node

    for found in matches:
        near = found.rows[found.distances_px <= tolerance_px] + firsts[list(found.pair)]
        for a, b in near.tolist():
            parents[root(a)] = root(b)
    roots = np.array([root(node) for node in range(len(parents))], np.intp)
    images = np.repeat(np.arange(len(sizes)), sizes)
    members = np.column_stack([roots, images, np.arange(len(roots)) - firsts[images]])
    members = members[np.lexsort(members.T[::-1])]
    _, back, counts = np.unique(members[:, :2], axis=0, return_inverse=True, return_counts=True)
    members = members[counts[back.ravel()] == 1]
    _, back, counts = np.unique(members[:, 0], return_inverse=True, return_counts=True)
    members = members[counts[back] >= 2]
    members[:, 0] = np.unique(members[:, 0], return_inverse=True)[1]
    result: Ints = members
    return result
