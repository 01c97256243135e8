"""Registration of two frames: the motion of the camera between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gslts._core import reloc as _core
from gslts.core.se3 import transform
from gslts.datasets.poses import inverse
from gslts.trajectory.constants import (
    CLOUD_APART_M,
    CLOUD_VOXEL_M,
    CONTRADICTION_STEP,
    MARGIN_M,
    MARGIN_PER_M,
    MAX_CONTRADICTION,
    MIN_DEPTH_M,
    MIN_INLIERS,
    MIN_OVERLAP,
)
from gslts.trajectory.features import FrameFeatures
from gslts.types import Floats


@dataclass(frozen=True, eq=False)
class Motion:
    """Motion of the camera between two frames.

    Attributes:
        target_from_source: [4,4] points of the source in the frame of the target, m.
        information: [6,6] of the points that both show (Choi et al. 2015, equation 9).
        overlap: Share of the points of the source that lie on surfaces of the target.
    """

    target_from_source: Floats
    information: Floats
    overlap: float


def register_frames(
    source: FrameFeatures, target: FrameFeatures, guess: Floats | None = None
) -> Motion | None:
    """Register two frames by their keypoints, then by their points (generalised ICP).

    Args:
        source: The frame that moves.
        target: The frame that stays.
        guess: [4,4] target_from_source by other means, used where keypoints tell nothing.

    Returns:
        None if they do not show the same place, or nothing tells the motion.
    """
    start = _motion_of_keypoints(source, target)
    if start is None:
        start = guess
    return None if start is None else register_points(source, target, start)


def register_points(source: FrameFeatures, target: FrameFeatures, start: Floats) -> Motion | None:
    """Register two frames by their points alone.

    Args:
        source: The frame that moves.
        target: The frame that stays.
        start: [4,4] target_from_source, some 10 cm off at most, m.

    Returns:
        None if they do not show the same place there.
    """
    rule = _core.CloudRule(voxel_m=CLOUD_VOXEL_M, max_distance_m=CLOUD_APART_M)
    found = _core.register_clouds(source.cloud, target.cloud, start, rule=rule)
    if found.overlap < MIN_OVERLAP:
        return None
    motion = np.array(found.target_from_source)
    through, seen = count_seen(source, target, motion)
    if through > MAX_CONTRADICTION * seen:
        return None
    return Motion(motion, _information(source, motion, found.overlap), found.overlap)


def _motion_of_keypoints(source: FrameFeatures, target: FrameFeatures) -> Floats | None:
    """Return target_from_source [4,4] that most keypoints support; None if too few do."""
    if min(source.size, target.size) < MIN_INLIERS:
        return None
    rule = _core.HypothesisRule(min_inliers=MIN_INLIERS)
    hypotheses = _core.hypotheses_of(
        source.camera, source.pixels, source.descriptors, source.depths, target.index, rule
    )
    return np.array(hypotheses[0].world_from_camera) if hypotheses else None


def _information(source: FrameFeatures, motion: Floats, overlap: float) -> Floats:
    """Sum the information of the points that overlap, in Open3D's order: rotation, translation."""
    points = transform(motion, source.cloud.astype(np.float64))
    jacobians = np.zeros((len(points), 3, 6))
    x, y, z = points.T
    jacobians[:, 0, 1], jacobians[:, 0, 2] = z, -y
    jacobians[:, 1, 0], jacobians[:, 1, 2] = -z, x
    jacobians[:, 2, 0], jacobians[:, 2, 1] = y, -x
    jacobians[:, :, 3:] = np.eye(3)
    flat = jacobians.reshape(-1, 6)
    return overlap * (flat.T @ flat)


def count_seen(source: FrameFeatures, target: FrameFeatures, motion: Floats) -> tuple[int, int]:
    """Count the points of two frames through which the other one saw, and all that it could see.

    Places that look alike, such as two shelves, differ in what is beside them.

    Args:
        source: A frame.
        target: Another one.
        motion: [4,4] target_from_source, m.
    """
    there, back = (
        _seen_points(source, target, motion),
        _seen_points(target, source, inverse(motion)),
    )
    return there[0] + back[0], there[1] + back[1]


def _seen_points(source: FrameFeatures, target: FrameFeatures, motion: Floats) -> tuple[int, int]:
    """Count the points of the source that the target saw through, and all that it could see."""
    points = transform(motion, source.cloud[::CONTRADICTION_STEP].astype(np.float64))
    points = points[points[:, 2] > MIN_DEPTH_M]
    height, width = target.seen_m.shape
    camera, z = target.camera, points[:, 2]
    columns = (points[:, 0] / z * camera.fx + camera.cx) * width / camera.width
    rows = (points[:, 1] / z * camera.fy + camera.cy) * height / camera.height
    inside = (columns >= 0) & (columns < width) & (rows >= 0) & (rows < height)
    z, cells = z[inside], (rows[inside].astype(int), columns[inside].astype(int))
    seen_m, margin_m = target.seen_m[cells], MARGIN_M + MARGIN_PER_M * z
    through = seen_m > z + margin_m
    on = (seen_m > 0) & (seen_m >= z - margin_m)
    return int(through.sum()), int(on.sum())
