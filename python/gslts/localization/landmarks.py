"""Landmarks of a map: corners of pictures, how they look, and where on its surfaces they are."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields
from itertools import product
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from gslts._core import edit as _edit
from gslts._core import reloc as _core
from gslts._core.map import GaussianViewFloat
from gslts.core.camera import Camera, new_viewpoints, unproject
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.types import Bools, Floats, Floats32

Bytes = NDArray[np.uint8]

MOST_BYTES = 4 << 20
"""Of the landmarks of a map, about 70,000: those of a home, and little beside its Gaussians."""
APART_M, APART_RAD = 0.15, np.deg2rad(10)
"""Pictures that are nearer than both show the same corners. ORB stands turns of the picture by any
angle, but other sides of a corner and other distances little: of a real room, a quarter more
corners are found again than with pictures 0.25 m or 15 degrees apart, and a twelfth fewer than with
ones 0.08 m or 5 degrees apart, which are half as many again."""
PER_KEYFRAME = 400
"""Corners of a picture, at most, spread over it: more are weak ones."""
LEAST_ALPHA = 0.9
"""Where the map is less opaque, its depth is a mixture of surfaces."""
AGREEING = 0.05
"""Relative difference of measured and rendered depth on one surface."""
EDGE_SHARE, EDGE_PX = 0.05, 2
"""A relative difference of depths so near to a pixel shows an edge, where a corner may belong to
either surface,"""
AGREEING_AT_EDGE = 0.03
"""and counts if so little is between what was measured and what the map shows."""
BORDER_PX = 16
"""Radius of what a descriptor looks at; none may look at what the camera did not see."""
ON_GAUSSIAN_M = 0.05
"""A corner so near to the centre of a Gaussian sits on it."""
SAME_M, SAME_BITS = 0.02, 30
"""Landmarks that are nearer, and whose descriptors differ in fewer of their 256 bits, are one: as
many corners of other pictures are found again as with all of them. With 60 bits, a tenth is lost.
"""

_HASH = np.array([73856093, 19349663, 83492791])
"""Teschner et al. 2003, Optimized Spatial Hashing for Collision Detection of Deformable Objects."""
_SIDES: tuple[Literal["left"], Literal["right"]] = ("left", "right")
_NEIGHBOURS = np.array([cell for cell in product((-1, 0, 1), repeat=3) if cell >= (0, 0, 0)])
"""Of a cell, each pair of cells once, and itself, which comes first."""


@dataclass(frozen=True, eq=False)
class Landmarks:
    """L corners with descriptors, seen from K keyframes.

    Args:
        positions: [L,3] float32, m, relative to the origin of their map, as `means` are.
        descriptors: [L,32] uint8, ORB, 256 bits.
        keyframes: [L] int32, row of the keyframe that each was seen from.
        world_from_keyframe: [K,4,4] float64, poses of the keyframes' cameras, m.
        gaussians: [L] uint64, id of the Gaussian that each sits on: when that goes, it goes too.

    Raises:
        ValueError: An array has a wrong shape or dtype or holds what cannot be; the message names
            it.
    """

    positions: Floats32
    descriptors: Bytes
    keyframes: NDArray[np.int32]
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
        if not _rigid(poses):
            raise ValueError("Landmarks: world_from_keyframe: must be rigid motions")

    @property
    def size(self) -> int:
        """How many there are, L."""
        return len(self.gaussians)

    @property
    def nbytes(self) -> int:
        """Bytes that its arrays take, in memory and, but for headers, on the disk."""
        return sum(getattr(self, field.name).nbytes for field in fields(self))

    def select(self, rows: NDArray[np.intp] | Bools) -> Landmarks:
        """Some of them, and the keyframes that these were seen from.

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

    def living(self, ids: NDArray[np.uint64]) -> Landmarks:
        """Those whose Gaussian is still there.

        Args:
            ids: [N] of the Gaussians of a version of the map.
        """
        return self.select(np.isin(self.gaussians, ids))


def joined(parts: Iterable[Landmarks]) -> Landmarks:
    """All landmarks of several, in their order; none of none."""
    every = [_nothing(), *parts]
    first = np.cumsum([0, *(len(one.world_from_keyframe) for one in every)])
    return Landmarks(
        np.concatenate([one.positions for one in every]),
        np.concatenate([one.descriptors for one in every]),
        np.concatenate(
            [one.keyframes + np.int32(row) for one, row in zip(every, first[:-1], strict=True)]
        ),
        np.concatenate([one.world_from_keyframe for one in every]),
        np.concatenate([one.gaussians for one in every]),
    )


def landmarks_of(
    gaussian_map: GaussianMap,
    frames: Iterable[RgbdFrame],
    wanted: Iterable[Bools] | None = None,
    *,
    most_bytes: int = MOST_BYTES,
    threads: int = 0,
) -> Landmarks:
    """Finds landmarks in pictures of what a map shows.

    Args:
        gaussian_map: float32.
        frames: Registered, where the map says that they were taken; depth may be missing. Those
            that look from elsewhere than all before them become keyframes.
        wanted: [H,W] of each frame, where landmarks are wanted; None means everywhere.
        most_bytes: If they took more, an even share of those of each keyframe is kept.
        threads: 0 means one a hardware thread.

    Raises:
        ValueError: The map is not float32.
    """
    rasterizer, options = Rasterizer(np.float32), RenderOptions(threads=threads)
    rule = _core.FeatureRule(count=PER_KEYFRAME)
    cameras: list[Camera] = []
    positions, descriptors = [np.zeros((0, 3))], [np.zeros((0, 32), np.uint8)]
    for frame, allowed in _keyframes(frames, wanted):
        images = rasterizer.forward(gaussian_map, frame.camera, options)
        depth = images.depth.astype(np.float32)
        sure = _on_surfaces(frame, depth, images.alpha >= LEAST_ALPHA)
        if allowed is not None:
            sure &= allowed
        pixels, looks = _core.features_of(grey_of(frame.rgb), sure, rule)
        columns, rows = np.floor(pixels).astype(np.intp).T
        places, depths_m = pixels.astype(np.float64), depth[rows, columns].astype(np.float64)
        positions.append(unproject(frame.camera, places, depths_m))
        descriptors.append(looks)
        cameras.append(frame.camera)
    counts = [len(one) for one in descriptors[1:]]
    points = (np.concatenate(positions) - gaussian_map.origin).astype(np.float32)
    gaussians, apart_m = _nearest(gaussian_map, points)
    found = Landmarks(
        points,
        np.concatenate(descriptors),
        np.repeat(np.arange(len(cameras), dtype=np.int32), counts),
        np.array([one.world_from_camera for one in cameras]).reshape(-1, 4, 4),
        gaussians,
    )
    return bounded(distinct(found.select(apart_m < ON_GAUSSIAN_M)), most_bytes)


def grey_of(rgb: Bytes) -> Bytes:
    """[H,W] brightness of a picture [H,W,3], sRGB."""
    return np.asarray(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY), np.uint8)


def distinct(landmarks: Landmarks) -> Landmarks:
    """Of those in one place that look the same, the first one."""
    kept = np.ones(landmarks.size, np.bool_)
    firsts, seconds = _alike(landmarks)
    for first, second in zip(firsts.tolist(), seconds.tolist(), strict=True):
        if kept[first]:
            kept[second] = False
    return landmarks.select(kept)


def bounded(landmarks: Landmarks, most_bytes: int) -> Landmarks:
    """All of them, or an even share of those of each keyframe that takes no more bytes."""
    if landmarks.nbytes <= most_bytes:
        return landmarks
    of_keyframes = landmarks.world_from_keyframe.nbytes
    share = max(0, most_bytes - of_keyframes) / (landmarks.nbytes - of_keyframes)
    order = np.argsort(landmarks.keyframes, kind="stable")
    _, starts, counts = np.unique(landmarks.keyframes[order], return_index=True, return_counts=True)
    ranks = np.arange(landmarks.size) - np.repeat(starts, counts)
    kept = np.floor((ranks + 1) * share) > np.floor(ranks * share)
    return landmarks.select(np.sort(order[kept]))


def _nothing() -> Landmarks:
    return Landmarks(
        np.zeros((0, 3), np.float32),
        np.zeros((0, 32), np.uint8),
        np.zeros(0, np.int32),
        np.zeros((0, 4, 4)),
        np.zeros(0, np.uint64),
    )


def _keyframes(
    frames: Iterable[RgbdFrame], wanted: Iterable[Bools] | None
) -> Iterator[tuple[RgbdFrame, Bools | None]]:
    """Frames that look from elsewhere than those before, and where landmarks are wanted."""
    known: list[Camera] = []
    masks = iter(()) if wanted is None else iter(wanted)
    for frame in frames:
        allowed = next(masks, None)
        if new_viewpoints(known, [frame.camera], APART_M, APART_RAD)[0]:
            known.append(frame.camera)
            yield frame, allowed


def _on_surfaces(frame: RgbdFrame, depth: Floats32, solid: Bools) -> Bools:
    """[H,W] where the map shows what the camera saw, and how far away it is.

    Args:
        frame: Registered.
        depth: [H,W] rendered, m.
        solid: [H,W] where the map is opaque.
    """
    window = np.ones((2 * EDGE_PX + 1,) * 2, np.uint8)
    nearest, farthest = cv2.erode(depth, window), cv2.dilate(depth, window)
    edge = farthest - nearest > EDGE_SHARE * nearest
    measured = np.nan_to_num(frame.depth)
    off = np.abs(measured - depth)
    agreeing = (measured > 0) & (off <= np.where(edge, AGREEING_AT_EDGE, AGREEING) * depth)
    sure: Bools = solid & (agreeing | ((measured == 0) & ~edge))
    if frame.mask is not None:
        patch = np.ones((2 * BORDER_PX + 1,) * 2, np.uint8)
        sure &= cv2.erode(frame.mask.astype(np.uint8), patch) > 0
    return sure


def _nearest(gaussian_map: GaussianMap, points: Floats32) -> tuple[NDArray[np.uint64], Floats32]:
    """The id of the Gaussian whose centre is nearest to each position, and how far."""
    if len(points) == 0:
        return np.zeros(0, np.uint64), np.zeros(0, np.float32)
    view = gaussian_map.view()
    assert isinstance(view, GaussianViewFloat)  # It was rendered as such.
    rows, apart_m = _edit.nearest_gaussians(view, points, 1)
    return gaussian_map.ids[rows[:, 0]], apart_m[:, 0]


def _alike(landmarks: Landmarks) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """[P] and [P] rows of pairs in one place that look the same, ordered by the second one."""
    positions, words = landmarks.positions, landmarks.descriptors.view(np.uint64)
    keys = np.floor(positions / SAME_M).astype(np.int64) @ _HASH
    order = np.argsort(keys, kind="stable")
    ordered = keys[order]
    pairs = [np.zeros((2, 0), np.intp)]
    for offset in _NEIGHBOURS:
        starts, ends = (np.searchsorted(ordered, keys + offset @ _HASH, side) for side in _SIDES)
        counts = ends - starts
        own = np.repeat(np.arange(landmarks.size), counts)
        other = order[np.arange(len(own)) + np.repeat(starts - np.cumsum(counts) + counts, counts)]
        pair = np.sort([own, other], axis=0)
        pair = pair[:, own != other]
        near = np.linalg.norm(positions[pair[0]] - positions[pair[1]], axis=1) < SAME_M
        pair = pair[:, near]
        bits = np.bitwise_count(words[pair[0]] ^ words[pair[1]]).sum(axis=1)
        pairs.append(pair[:, bits < SAME_BITS])
    firsts, seconds = np.concatenate(pairs, axis=1)
    by_second = np.lexsort((firsts, seconds))
    return firsts[by_second], seconds[by_second]


def _rigid(poses: Floats) -> bool:
    turns = poses[:, :3, :3]
    if not (np.isfinite(poses).all() and (np.abs(turns) < 1.1).all()):
        return False  # Their products might not be finite.
    square = np.allclose(turns @ turns.transpose(0, 2, 1), np.eye(3), rtol=0, atol=1e-5)
    right_handed = bool((np.linalg.det(turns) > 0).all())
    return square and right_handed and bool((poses[:, 3] == (0, 0, 0, 1)).all())
