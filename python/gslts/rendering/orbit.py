"""A smooth way around a scene, along cameras that have seen it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gslts.core.camera import Camera, at_pose
from gslts.core.se3 import rotation_of_quat
from gslts.types import Floats

SECTORS = 12
"""Directions from the middle in which a camera is looked for."""
LEAST = 0.3
"""Length below which the direction of a sum of unit vectors means nothing."""
M_PER_RAD = 1.0
"""Turning by a radian takes as long as going so far."""


def orbit(cameras: Sequence[Camera], count: int) -> list[Camera]:
    """A closed way, at even pace, through those cameras that look most at the middle.

    Of the cameras in each sector around their mean place, the one is taken that looks most towards
    it: a robot looks at all sides, and who walks around a room wants to see what is inside.

    Args:
        cameras: At least one; the intrinsics of the first are those of the result.
        count: Of the cameras on the way.

    Raises:
        ValueError: There is no camera.
    """
    if not cameras:
        raise ValueError("orbit: there is no camera")
    poses = np.stack([camera.world_from_camera for camera in cameras])
    up, keys = -poses[:, :3, 1].mean(axis=0), _keys(poses)
    places, quats = keys[:, :3, 3], _aligned(np.stack([_quat(key[:3, :3]) for key in keys]))
    turns_rad = 2 * np.arccos(np.abs((quats * np.roll(quats, -1, axis=0)).sum(axis=1)).clip(0, 1))
    apart_m = np.linalg.norm(np.roll(places, -1, axis=0) - places, axis=1)
    ends = np.concatenate([[0], np.cumsum(apart_m + M_PER_RAD * turns_rad + 1e-9)])
    wanted = np.interp(np.arange(count) * ends[-1] / count, ends, np.arange(len(ends)))
    rows = np.column_stack([places, quats])
    # Back at the start a quaternion may have changed its sign.
    sign = 1.0 if quats[-1] @ quats[0] >= 0 else -1.0
    return [at_pose(cameras[0], _pose(_spline(rows, at, sign), up)) for at in wanted]


def _keys(poses: Floats) -> Floats:
    """[K,4,4] of [N,4,4], by the direction from the middle."""
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
    """Catmull-Rom spline through rows (place, quaternion), closed; `at` counts rows."""
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


def _aligned(quats: Floats) -> Floats:
    """The same rotations, each quaternion on the side of the one before."""
    for row in range(1, len(quats)):
        if quats[row] @ quats[row - 1] < 0:
            quats[row] *= -1
    return quats


def _quat(turn: Floats) -> Floats:
    """(4,) wxyz of a rotation [3,3]: an eigenvector, as of Bar-Itzhack (2000)."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = turn
    symmetric = np.array(
        [
            [xx + yy + zz, zy - yz, xz - zx, yx - xy],
            [zy - yz, xx - yy - zz, xy + yx, xz + zx],
            [xz - zx, xy + yx, yy - xx - zz, yz + zy],
            [yx - xy, xz + zx, yz + zy, zz - xx - yy],
        ]
    )
    quat: Floats = np.linalg.eigh(symmetric)[1][:, -1]
    return quat


def _pose(row: Floats, up: Floats) -> Floats:
    """[4,4] with a level horizon: on the way from one view to another, the spline leans over.

    Args:
        row: Place and quaternion.
        up: (3,) mean of the cameras' directions up; shorter the less they agree.
    """
    turn, length = rotation_of_quat(row[3:]), float(np.linalg.norm(up))
    right = turn[:, 0] - (turn[:, 0] @ up) * up / max(length, LEAST) ** 2
    if min(length, float(np.linalg.norm(right))) > LEAST:
        right /= np.linalg.norm(right)
        forward = turn[:, 2] - (turn[:, 2] @ right) * right
        forward /= np.linalg.norm(forward)
        turn = np.column_stack([right, np.cross(forward, right), forward])
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turn, row[:3]
    return pose
