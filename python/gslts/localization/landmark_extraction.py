"""Extracts landmarks from the frames of a map."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import cv2
import numpy as np
from numpy.typing import NDArray

from gslts._core import edit as _edit
from gslts._core import reloc as _core
from gslts._core.map import GaussianViewFloat
from gslts.core.camera import Camera, new_viewpoints, unproject
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.localization.constants import (
    DEPTH_TOLERANCE,
    DESCRIPTOR_RADIUS_PX,
    EDGE_DEPTH_TOLERANCE,
    EDGE_PX,
    EDGE_STEP,
    KEYFRAME_APART_M,
    KEYFRAME_APART_RAD,
    KEYFRAME_KEYPOINTS,
    LANDMARK_BYTES,
    MAX_GAUSSIAN_DISTANCE_M,
    MIN_ALPHA,
)
from gslts.localization.landmarks import Landmarks, limit_size, remove_duplicates
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.rendering.view_range import view_range_m
from gslts.types import Bools, Bytes, Floats32


def extract_landmarks(
    gaussian_map: GaussianMap,
    frames: Iterable[RgbdFrame],
    wanted: Iterable[Bools] | None = None,
    *,
    max_bytes: int = LANDMARK_BYTES,
    threads: int = 0,
) -> Landmarks:
    """Detect keypoints in frames and place them on the surfaces of the map.

    Args:
        gaussian_map: float32.
        frames: Registered frames at their poses in the map; depth may be missing. Those from new
            viewpoints become keyframes.
        wanted: [H,W] of each frame, True where landmarks are wanted; None means everywhere.
        max_bytes: Maximum size; beyond it, an even share of those of each keyframe is kept.
        threads: Number of threads; 0 means one per hardware thread.

    Raises:
        ValueError: The map is not float32.
    """
    rasterizer, plain = Rasterizer(np.float32), gaussian_map.without_features()
    rule = _core.FeatureRule(count=KEYFRAME_KEYPOINTS)
    cameras: list[Camera] = []
    positions, descriptors = [np.zeros((0, 3))], [np.zeros((0, 32), np.uint8)]
    for frame, allowed in _keyframes(frames, wanted):
        options = RenderOptions(far_m=view_range_m(frame.depth), threads=threads)
        images = rasterizer.forward(plain, frame.camera, options)
        depth = images.depth.astype(np.float32)
        valid = _on_surfaces(frame, depth, images.alpha >= MIN_ALPHA)
        if allowed is not None:
            valid &= allowed
        pixels, found = _core.features_of(gray_image(frame.rgb), valid, rule)
        columns, rows = np.floor(pixels).astype(np.intp).T
        depths_m = depth[rows, columns].astype(np.float64)
        positions.append(unproject(frame.camera, pixels.astype(np.float64), depths_m))
        descriptors.append(found)
        cameras.append(frame.camera)
    counts = [len(found) for found in descriptors[1:]]
    points = (np.concatenate(positions) - gaussian_map.origin).astype(np.float32)
    gaussians, distances_m = _nearest(gaussian_map, points)
    landmarks = Landmarks(
        points,
        np.concatenate(descriptors),
        np.repeat(np.arange(len(cameras), dtype=np.int32), counts),
        np.array([camera.world_from_camera for camera in cameras]).reshape(-1, 4, 4),
        gaussians,
    )
    landmarks = landmarks.select(distances_m < MAX_GAUSSIAN_DISTANCE_M)
    return limit_size(remove_duplicates(landmarks), max_bytes)


def gray_image(rgb: Bytes) -> Bytes:
    """Return [H,W] brightness of an image.

    Args:
        rgb: [H,W,3] sRGB.
    """
    return np.asarray(cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY), np.uint8)


def _keyframes(
    frames: Iterable[RgbdFrame], wanted: Iterable[Bools] | None
) -> Iterator[tuple[RgbdFrame, Bools | None]]:
    """Yield the frames from new viewpoints, with their masks."""
    known: list[Camera] = []
    masks = iter(()) if wanted is None else iter(wanted)
    for frame in frames:
        allowed = next(masks, None)
        if new_viewpoints(known, [frame.camera], KEYFRAME_APART_M, KEYFRAME_APART_RAD)[0]:
            known.append(frame.camera)
            yield frame, allowed


def _on_surfaces(frame: RgbdFrame, depth: Floats32, solid: Bools) -> Bools:
    """Select the pixels where the map shows what the camera saw, at a reliable depth.

    Args:
        frame: Registered.
        depth: [H,W] rendered, m.
        solid: [H,W] True where the map is opaque.
    """
    window = np.ones((2 * EDGE_PX + 1,) * 2, np.uint8)
    nearest, farthest = cv2.erode(depth, window), cv2.dilate(depth, window)
    edge = farthest - nearest > EDGE_STEP * nearest
    measured = np.nan_to_num(frame.depth)
    tolerance = np.where(edge, EDGE_DEPTH_TOLERANCE, DEPTH_TOLERANCE)
    agreeing = (measured > 0) & (np.abs(measured - depth) <= tolerance * depth)
    valid: Bools = solid & (agreeing | ((measured == 0) & ~edge))
    if frame.mask is not None:
        patch = np.ones((2 * DESCRIPTOR_RADIUS_PX + 1,) * 2, np.uint8)
        valid &= cv2.erode(frame.mask.astype(np.uint8), patch) > 0
    return valid


def _nearest(gaussian_map: GaussianMap, points: Floats32) -> tuple[NDArray[np.uint64], Floats32]:
    """Return the id of the Gaussian with the nearest centre to each point, and its distance, m.

    A distance above `MAX_GAUSSIAN_DISTANCE_M` may be that of another Gaussian.
    """
    if len(points) == 0:
        return np.zeros(0, np.uint64), np.zeros(0, np.float32)
    world = points + gaussian_map.origin
    low, high = world.min(axis=0), world.max(axis=0)
    near = gaussian_map.select(
        gaussian_map.rows_in_box(low - MAX_GAUSSIAN_DISTANCE_M, high + MAX_GAUSSIAN_DISTANCE_M)
    )
    if near.size == 0:
        return np.zeros(len(points), np.uint64), np.full(len(points), np.inf, np.float32)
    view = near.view()
    assert isinstance(view, GaussianViewFloat)  # It was rendered as such.
    rows, distances_m = _edit.nearest_gaussians(view, points, 1)
    return near.ids[rows[:, 0]], distances_m[:, 0]
