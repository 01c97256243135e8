"""Landmarks of a map: keypoints of keyframes with descriptors and positions on its surfaces."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields
from itertools import product
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gslts.core.gaussian_map import GaussianMap
from gslts.localization.constants import SAME_LANDMARK_BITS, SAME_LANDMARK_M
from gslts.types import Bools, Bytes, Floats, Floats32, Ints32

_HASH = np.array([73856093, 19349663, 83492791])
"""Teschner et al. 2003, Optimized Spatial Hashing for Collision Detection of Deformable Objects."""
_SIDES: tuple[Literal["left"], Literal["right"]] = ("left", "right")
"""Sides of `searchsorted`, whose results bound the equal keys."""
_NEIGHBOURS = np.array(list(product((-1, 0, 1), repeat=3)))
"""Offsets of a cell to itself and to its neighbours."""
_BLOCK = 1024
"""Maximum number of landmarks of which all pairs in a cell are compared: a landmark that is seen
often is compared with each of its other sightings. Half of it takes as long in total."""


@dataclass(frozen=True, eq=False)
class Landmarks:
    """L keypoints with descriptors and positions, seen from K keyframes.

    Args:
        positions: [L,3] float32, m, relative to the origin of their map, as `means` are.
        descriptors: [L,32] uint8, ORB, 256 bits.
        keyframes: [L] int32, row of the keyframe from which each was seen.
        world_from_keyframe: [K,4,4] float64, poses of the cameras of the keyframes, m.
        gaussians: [L] uint64, id of the Gaussian that each belongs to and is removed with.

    Raises:
        ValueError: An array has a wrong shape or dtype or an invalid value.
    """

    positions: Floats32
    descriptors: Bytes
    keyframes: Ints32
    world_from_keyframe: Floats
    gaussians: NDArray[np.uint64]

    def __post_init__(self) -> None:
        size, poses = self.gaussians.size, self.world_from_keyframe
        for name, dtype, shape in (
            ("gaussians", np.uint64, (size,)),
            ("positions", np.float32, (size, 3)),
            ("descriptors", np.uint8, (size, 32)),
            ("keyframes", np.int32, (size,)),
            ("world_from_keyframe", np.float64, (*poses.shape[:1], 4, 4)),
        ):
            array = getattr(self, name)
            if array.dtype != dtype or array.shape != shape:
                raise ValueError(
                    f"Landmarks: {name}: expected {np.dtype(dtype)} {shape}, got {array.dtype} "
                    f"{array.shape}"
                )
        if not np.isfinite(self.positions).all():
            raise ValueError("Landmarks: positions: must be finite")
        if size and not 0 <= self.keyframes.min() <= self.keyframes.max() < len(poses):
            raise ValueError(f"Landmarks: keyframes: must be in 0..{len(poses) - 1}")
        if not _are_rigid(poses):
            raise ValueError("Landmarks: world_from_keyframe: must be rigid motions")

    @classmethod
    def empty(cls) -> Landmarks:
        """Return no landmarks."""
        return cls(
            np.zeros((0, 3), np.float32),
            np.zeros((0, 32), np.uint8),
            np.zeros(0, np.int32),
            np.zeros((0, 4, 4)),
            np.zeros(0, np.uint64),
        )

    @property
    def size(self) -> int:
        """Number of landmarks, L."""
        return len(self.gaussians)

    @property
    def nbytes(self) -> int:
        """Size of the arrays, bytes, in memory and, without headers, on disk."""
        return sum(getattr(self, field.name).nbytes for field in fields(self))

    def select(self, rows: NDArray[np.intp] | Bools) -> Landmarks:
        """Return some landmarks, and the keyframes from which these were seen.

        Args:
            rows: [M] integers or [L] bool.
        """
        used, keyframes = np.unique(self.keyframes[rows], return_inverse=True)
        return Landmarks(
            self.positions[rows],
            self.descriptors[rows],
            keyframes.astype(np.int32),
            self.world_from_keyframe[used],
            self.gaussians[rows],
        )

    def of_gaussians(self, gaussian_map: GaussianMap) -> Landmarks:
        """Return the landmarks whose Gaussian is in a version of the map.

        Args:
            gaussian_map: The version, with rising ids.
        """
        return self.select(gaussian_map.has_ids(self.gaussians))


def concatenate(parts: Iterable[Landmarks]) -> Landmarks:
    """Join landmarks of several sources, in their order.

    Args:
        parts: Any number of landmarks of one map.
    """
    parts = [Landmarks.empty(), *parts]
    first_rows = np.cumsum([0, *(len(part.world_from_keyframe) for part in parts)])[:-1]
    return Landmarks(
        np.concatenate([part.positions for part in parts]),
        np.concatenate([part.descriptors for part in parts]),
        np.concatenate(
            [part.keyframes + np.int32(row) for part, row in zip(parts, first_rows, strict=True)]
        ),
        np.concatenate([part.world_from_keyframe for part in parts]),
        np.concatenate([part.gaussians for part in parts]),
    )


def remove_duplicates(landmarks: Landmarks) -> Landmarks:
    """Keep the first of several landmarks at one position with similar descriptors.

    Args:
        landmarks: Landmarks of several keyframes.
    """
    return landmarks.select(_without_duplicates(landmarks, np.arange(landmarks.size)))


def limit_size(landmarks: Landmarks, max_bytes: int) -> Landmarks:
    """Keep an even share of the landmarks of each keyframe so that they fit a size.

    Args:
        landmarks: Landmarks; they come back if they fit.
        max_bytes: Maximum of `nbytes`, unless the keyframes alone take more.
    """
    if landmarks.nbytes <= max_bytes:
        return landmarks
    of_keyframes = landmarks.world_from_keyframe.nbytes
    share = max(0, max_bytes - of_keyframes) / (landmarks.nbytes - of_keyframes)
    order = np.argsort(landmarks.keyframes, kind="stable")
    _, starts, counts = np.unique(landmarks.keyframes[order], return_index=True, return_counts=True)
    ranks = np.arange(landmarks.size) - np.repeat(starts, counts)
    kept = np.floor((ranks + 1) * share) > np.floor(ranks * share)
    return landmarks.select(np.sort(order[kept]))


def _without_duplicates(landmarks: Landmarks, rows: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the rows, in their order, that are no duplicates of earlier ones of them.

    The second half is compared with what is kept of the first one, so that the number of pairs
    does not grow with the square of how often a landmark was seen.
    """
    if len(rows) <= _BLOCK:
        dropped: set[int] = set()
        for first, second in _duplicates(landmarks, rows, rows).T.tolist():
            if first not in dropped:
                dropped.add(second)
        return rows[[row not in dropped for row in rows.tolist()]]
    half = len(rows) // 2
    kept, others = _without_duplicates(landmarks, rows[:half]), rows[half:]
    others = others[~np.isin(others, _duplicates(landmarks, kept, others)[1])]
    return np.concatenate([kept, _without_duplicates(landmarks, others)])


def _duplicates(
    landmarks: Landmarks, firsts: NDArray[np.intp], seconds: NDArray[np.intp]
) -> NDArray[np.intp]:
    """Return [2,P] similar pairs at one position, of an earlier and a later row, by the later."""
    positions, words = landmarks.positions, landmarks.descriptors.view(np.uint64)
    keys, wanted = (
        np.floor(positions[rows] / SAME_LANDMARK_M).astype(np.int64) @ _HASH
        for rows in (firsts, seconds)
    )
    order = np.argsort(keys, kind="stable")
    ordered = keys[order]
    pairs = [np.zeros((2, 0), np.intp)]
    for offset in _NEIGHBOURS:
        starts, ends = (np.searchsorted(ordered, wanted + offset @ _HASH, side) for side in _SIDES)
        counts = ends - starts
        found = np.arange(counts.sum()) + np.repeat(starts - np.cumsum(counts) + counts, counts)
        pair = np.array([firsts[order[found]], np.repeat(seconds, counts)])
        pair = pair[:, pair[0] < pair[1]]
        near = np.linalg.norm(positions[pair[0]] - positions[pair[1]], axis=1) < SAME_LANDMARK_M
        pair = pair[:, near]
        bits = np.bitwise_count(words[pair[0]] ^ words[pair[1]]).sum(axis=1)
        pairs.append(pair[:, bits < SAME_LANDMARK_BITS])
    joined = np.concatenate(pairs, axis=1)
    return joined[:, np.lexsort(joined)]


def _are_rigid(poses: Floats) -> bool:
    turns = poses[:, :3, :3]
    if not (np.isfinite(poses).all() and (np.abs(turns) < 1.1).all()):
        return False  # Their products might not be finite.
    square = np.allclose(turns @ turns.transpose(0, 2, 1), np.eye(3), rtol=0, atol=1e-5)
    right_handed = bool((np.linalg.det(turns) > 0).all())
    return square and right_handed and bool((poses[:, 3] == (0, 0, 0, 1)).all())
