"""Smooth closed camera path around a scene, through cameras that have seen it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gslts.core.camera import Camera, at_pose
from gslts.core.se3 import quats_of_rotations, rotation_of_quat
from gslts.types import Floats

SECTORS = 12
"""Number of sectors around the middle, each with one key camera: more make the path longer."""
MIN_LENGTH = 0.3
"""Minimum length of a mean of unit vectors whose direction is used."""
M_PER_RAD = 1.0
"""Distance that takes as long as a rotation by one radian, m: the pace of the path."""


def orbit(cameras: Sequence[Camera], count: int) -> list[Camera]:
    """Return cameras on a closed path, at even pace, that looks inward.

    In each sector around the mean position, the path passes the camera that looks most towards the
    middle: recordings look to all sides, but a viewer wants to see the inside.

    Args:
        cameras: At least one; the first gives the intrinsics.
        count: Number of cameras on the path.

    Raises:
        ValueError: There is no camera.
    """
    if not cameras:
        raise ValueError("orbit: there is no camera")
    poses = np.stack([camera.world_from_camera for camera in cameras])
    up, keys = -poses[:, :3, 1].mean(axis=0), _keys(poses)
    positions, quats = keys[:, :3, 3], _align(quats_of_rotations(keys[:, :3, :3]))
    turns_rad = 2 * np.arccos(np.abs((quats * np.roll(quats, -1, axis=0)).sum(axis=1)).clip(0, 1))
    steps_m = np.linalg.norm(np.roll(positions, -1, axis=0) - positions, axis=1)
    ends = np.concatenate([[0], np.cumsum(steps_m + M_PER_RAD * turns_rad + 1e-9)])
    wanted = np.interp(np.arange(count) * ends[-1] / count, ends, np.arange(len(ends)))
    rows = np.column_stack([positions, quats])
    # After one round the quaternion may have the other sign.
    sign = 1.0 if quats[-1] @ quats[0] >= 0 else -1.0
    return [at_pose(cameras[0], _pose(_spline(rows, at, sign), up)) for at in wanted]


def _keys(poses: Floats) -> Floats:
    """Return key poses [K,4,4] of poses [N,4,4], one per sector around the middle."""
    outward = poses[:, :2, 3] - poses[:, :2, 3].mean(axis=0)
    sectors = np.floor(SECTORS * (np.arctan2(outward[:, 1], outward[:, 0]) / (2 * np.pi) + 0.5))
    inward = -(poses[:, :2, 2] * outward).sum(axis=1) / (np.linalg.norm(outward, axis=1) + 0.1)
    best = [
        members[np.argmax(inward[members])]
        for members in (np.flatnonzero(sectors == sector) for sector in np.unique(sectors))
    ]
    keys: Floats = poses[best]
    return keys


def _spline(rows: Floats, at: float, sign: float) -> Floats:
    """Interpolate rows (position, quaternion) by a closed Catmull-Rom spline; `at` counts rows."""
    start = int(at)
    four = []
    for number in range(start - 1, start + 3):
        row = rows[number % len(rows)].copy()
        if number // len(rows) != 0:
            row[3:] *= sign
        four.append(row)
    t = at - start
    before, first, second, after = four
    result: Floats = 0.5 * (
        2 * first
        + (second - before) * t
        + (2 * before - 5 * first + 4 * second - after) * t**2
        + (3 * first - before - 3 * second + after) * t**3
    )
    return result


def _align(quats: Floats) -> Floats:
    """Flip signs of quaternions so that each is nearest to the one before."""
    for row in range(1, len(quats)):
        if quats[row] @ quats[row - 1] < 0:
            quats[row] *= -1
    return quats


def _pose(row: Floats, up: Floats) -> Floats:
    """Return a pose [4,4] with a level horizon; the spline alone would roll between keys.

    Args:
        row: Position and quaternion.
        up: (3,) mean of the cameras' up directions; the shorter the less they agree.
    """
    turn, length = rotation_of_quat(row[3:]), float(np.linalg.norm(up))
    right = turn[:, 0] - (turn[:, 0] @ up) * up / max(length, MIN_LENGTH) ** 2
    if min(length, float(np.linalg.norm(right))) > MIN_LENGTH:
        right /= np.linalg.norm(right)
        forward = turn[:, 2] - (turn[:, 2] @ right) * right
        forward /= np.linalg.norm(forward)
        turn = np.column_stack([right, np.cross(forward, right), forward])
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turn, row[:3]
    return pose
