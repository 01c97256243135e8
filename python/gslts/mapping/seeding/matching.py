"""Which points of posed pictures are pictures of one point of the scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gslts.core.camera import Camera
from gslts.mapping.seeding.sift import Features
from gslts.types import Floats

Integers = NDArray[np.intp]

PARTNERS = 8
"""Pictures that each one is matched with."""
WIDEST_VIEW_RAD = np.deg2rad(45)
"""Between viewing directions; beyond, SIFT finds little again."""
SAME_PLACE = 1e-3
"""Of the median distance between cameras: nearer ones have no baseline."""
RATIO = 0.8
"""Of the distances to the best and the second-best descriptor (Lowe 2004)."""
WIDEST_BAND_PX = 12.0
"""From the epipolar line. Poses that are off by 1 cm and half a degree move it by 7 px."""


@dataclass(frozen=True, eq=False)
class Matches:
    """Features of two pictures that look alike and lie where the poses allow it.

    Attributes:
        pair: Numbers of the pictures.
        rows: [M,2] of the features in them.
        distances_px: [M] from the epipolar line in the second picture.
    """

    pair: tuple[int, int]
    rows: Integers
    distances_px: Floats


def pairs(cameras: Sequence[Camera]) -> list[tuple[int, int]]:
    """Pairs (i, j), i < j, that may see the same from places apart.

    The scale of the scene is not known, and cameras may be dense as in a film or few: the partners
    of each are near ones and ever farther ones, out of all that look the same way.
    """
    if len(cameras) < 2:
        return []
    centres = np.array([camera.world_from_camera[:3, 3] for camera in cameras])
    views = np.array([camera.world_from_camera[:3, 2] for camera in cameras])
    alike = views @ views.T > np.cos(WIDEST_VIEW_RAD)
    apart = np.linalg.norm(centres[:, None] - centres, axis=2)
    alike &= apart > SAME_PLACE * np.median(apart)
    found = set()
    for i in range(len(cameras)):
        partners = np.flatnonzero(alike[i])
        partners = partners[np.argsort(apart[i, partners], kind="stable")]
        if len(partners) == 0:
            continue
        ladder = np.geomspace(1, len(partners), PARTNERS).round().astype(int) - 1
        found |= {(min(i, j), max(i, j)) for j in partners[ladder].tolist()}
    return sorted(found)


def matched(pair: tuple[int, int], cameras: Sequence[Camera], found: Sequence[Features]) -> Matches:
    """Features that are each other's best, clearly better than all others, and near the line."""
    first, second = (found[row] for row in pair)
    if len(first.places) < 2 or len(second.places) < 2:
        return Matches(pair, np.zeros((0, 2), np.intp), np.zeros(0))
    a, b = first.descriptors, second.descriptors
    unlike = a @ (-2 * b).T
    unlike += (a**2).sum(axis=1)[:, None]
    unlike += (b**2).sum(axis=1)
    i, best = np.arange(len(a)), unlike.argmin(axis=1)
    least = unlike[i, best]
    good = least == unlike.min(axis=0)[best]
    unlike[i, best] = np.inf
    good &= least < RATIO**2 * unlike.min(axis=1)
    rows = np.column_stack([i, best])[good]
    away_px = _from_epipolar_lines(
        cameras[pair[0]], cameras[pair[1]], first.places[rows[:, 0]], second.places[rows[:, 1]]
    )
    near = away_px <= WIDEST_BAND_PX
    return Matches(pair, rows[near], away_px[near])


def _from_epipolar_lines(
    first: Camera, second: Camera, in_first: Floats, in_second: Floats
) -> Floats:
    """[M] px in the second picture, of its points [M,2] from the lines of those of the first."""
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
    """[3,3] that takes points of the camera frame to homogeneous px."""
    return np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])


def tracks(sizes: Sequence[int], matches: Sequence[Matches], tolerance_px: float) -> Integers:
    """Features that are joined by matches, over all pictures.

    Args:
        sizes: Numbers of features of the pictures.
        matches: Of pairs of them.
        tolerance_px: Matches farther from the epipolar line are not used.

    Returns:
        [K,3]: number of the track, picture, feature; by tracks, at least two pictures each. Where a
        track has several features in a picture, they are left out.
    """
    firsts = np.concatenate([[0], np.cumsum(sizes)])
    parents = list(range(int(firsts[-1])))

    def root(node: int) -> int:
        while parents[node] != node:
            parents[node] = parents[parents[node]]
            node = parents[node]
        return node

    for one in matches:
        near = one.rows[one.distances_px <= tolerance_px] + firsts[list(one.pair)]
        for a, b in near.tolist():
            parents[root(a)] = root(b)
    roots = np.array([root(node) for node in range(len(parents))], np.intp)
    pictures = np.repeat(np.arange(len(sizes)), sizes)
    members = np.column_stack([roots, pictures, np.arange(len(roots)) - firsts[pictures]])
    members = members[np.lexsort(members.T[::-1])]
    _, back, counts = np.unique(members[:, :2], axis=0, return_inverse=True, return_counts=True)
    members = members[counts[back.ravel()] == 1]
    _, back, counts = np.unique(members[:, 0], return_inverse=True, return_counts=True)
    members = members[counts[back] >= 2]
    members[:, 0] = np.unique(members[:, 0], return_inverse=True)[1]
    result: Integers = members
    return result
