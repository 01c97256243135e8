"""Pinhole cameras and their poses."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from gslts._core.map import Camera, camera_from_fov, look_at
from gslts.types import Floats

__all__ = [
    "Camera",
    "apart",
    "at_pose",
    "camera_from_fov",
    "lifted",
    "look_at",
    "moved",
    "new_viewpoints",
    "resized",
    "rotation",
    "rotation_of_quat",
    "rotation_vector",
    "seen_from",
    "twist_of",
]


APART_M, APART_RAD = 0.4, np.deg2rad(20)
"""Cameras that are nearer than both show much the same."""


def at_pose(camera: Camera, world_from_camera: Floats) -> Camera:
    """The same camera elsewhere.

    Args:
        camera: Whose intrinsics are taken.
        world_from_camera: [4,4], rigid, m.

    Raises:
        ValueError: The pose is not rigid.
    """
    return Camera(
        fx=camera.fx,
        fy=camera.fy,
        cx=camera.cx,
        cy=camera.cy,
        width=camera.width,
        height=camera.height,
        world_from_camera=world_from_camera,
    )


def seen_from(camera: Camera, origin: Floats) -> Camera:
    """The same camera in a frame that starts at a place (3,), such as the origin of a map, m."""
    pose = camera.world_from_camera
    pose[:3, 3] -= origin
    return at_pose(camera, pose)


def resized(camera: Camera, divisor: int) -> Camera:
    """The camera of an image whose sides are divided by a number; what is left over is cut off."""
    return Camera(
        fx=camera.fx / divisor,
        fy=camera.fy / divisor,
        cx=camera.cx / divisor,
        cy=camera.cy / divisor,
        width=camera.width // divisor,
        height=camera.height // divisor,
        world_from_camera=camera.world_from_camera,
    )


def moved(camera: Camera, twist: Floats) -> Camera:
    """The camera at world_from_camera @ exp(xi), with exp to first order in the translation."""
    step = np.eye(4)
    step[:3, :3], step[:3, 3] = rotation(twist[3:]), twist[:3]
    return at_pose(camera, product(camera.world_from_camera, step))


def lifted(camera: Camera, places: Floats, depths_m: Floats) -> Floats:
    """[P,3] points in the world at places [P,2] of a picture, px, and depths [P]."""
    x = (places[:, 0] - camera.cx) / camera.fx
    y = (places[:, 1] - camera.cy) / camera.fy
    in_camera = np.column_stack([x, y, np.ones(len(places))]) * depths_m[:, None]
    return transform(camera.world_from_camera, in_camera)


def transform(b_from_a: Floats, points: Floats) -> Floats:
    """Carries points from one frame into another.

    Sums in one order: a matrix product of NumPy (OpenBLAS) rounds differently from processor to
    processor.

    Args:
        b_from_a: [4,4] rigid.
        points: [...,3] in frame a, m.

    Returns:
        [...,3] in frame b, m, float64.
    """
    turn, shift = b_from_a[:3, :3], b_from_a[:3, 3]
    x, y, z = (points[..., i, None] for i in range(3))
    result: Floats = x * turn[:, 0] + y * turn[:, 1] + z * turn[:, 2] + shift
    return result


def product(first: Floats, second: Floats) -> Floats:
    """Multiplies small matrices [N,K] and [K,M], summing in one order; see `transform`."""
    result: Floats = (first[:, :, None] * second[None]).sum(axis=1)
    return result


def relative(world_from_a: Floats, world_from_b: Floats) -> Floats:
    """Returns a_from_b [4,4] of two rigid poses [4,4]."""
    result = np.eye(4)
    result[:3, :3] = product(world_from_a[:3, :3].T, world_from_b[:3, :3])
    result[:3, 3] = inverse_transform(world_from_a, world_from_b[:3, 3])
    return result


def inverse_transform(b_from_a: Floats, points: Floats) -> Floats:
    """Carries points [...,3] back from frame b into frame a; see `transform`."""
    turn, shift = b_from_a[:3, :3], b_from_a[:3, 3]
    x, y, z = (points[..., i, None] - shift[i] for i in range(3))
    result: Floats = x * turn[0] + y * turn[1] + z * turn[2]
    return result


def new_viewpoints(
    known: Iterable[Camera],
    more: Iterable[Camera],
    apart_m: float = APART_M,
    apart_rad: float = APART_RAD,
) -> list[bool]:
    """Which cameras look from elsewhere than all known ones and those before them.

    However often a robot comes back to where it was, there are no more of them than there are
    viewpoints in a home.

    Args:
        known: From where it was looked before.
        more: From where it is looked now.
        apart_m: Cameras that are nearer than this,
        apart_rad: and turned by less, show much the same.
    """
    poses = [one.world_from_camera for one in known]
    new = []
    for camera in more:
        pose = camera.world_from_camera
        others = np.array(poses).reshape(-1, 4, 4)
        metres = np.linalg.norm(others[:, :3, 3] - pose[:3, 3], axis=1)
        turns_rad = np.arccos(np.clip(others[:, :3, 2] @ pose[:3, 2], -1, 1))
        new.append(not ((metres < apart_m) & (turns_rad < apart_rad)).any())
        if new[-1]:
            poses.append(pose)
    return new


def apart(first: Floats, second: Floats) -> tuple[float, float]:
    """How far two poses [4,4] are apart, m and rad."""
    motion = relative(first, second)
    turn_rad = np.arccos(np.clip((np.trace(motion[:3, :3]) - 1) / 2, -1, 1))
    return float(np.linalg.norm(motion[:3, 3])), float(turn_rad)


def twist_of(motion: Floats) -> Floats:
    """(6,) the twist whose `moved` is a rigid motion [4,4], for turns well below pi."""
    return np.concatenate([motion[:3, 3], rotation_vector(motion[:3, :3])])


def rotation(vector_rad: Floats) -> Floats:
    """[3,3] rotation about a vector (3,) by its length, rad (Rodrigues' formula)."""
    angle = _length(vector_rad)
    if angle == 0:
        return np.eye(3)
    x, y, z = vector_rad / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    result: Floats = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * product(cross, cross)
    return result


def _length(vector: Floats) -> float:
    """Returns the length of a vector (N,), summed in one order; see `transform`."""
    return float(np.sqrt((vector * vector).sum()))


def rotation_vector(turn: Floats) -> Floats:
    """(3,) inverse of `rotation`, rad, for angles well below pi."""
    axis = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    sine, cosine = 0.5 * _length(axis), 0.5 * (float(np.trace(turn)) - 1)
    angle = np.arctan2(sine, cosine)
    result: Floats = axis * (0.5 if sine < 1e-9 else 0.5 * angle / sine)
    return result


def rotation_of_quat(quat: Floats) -> Floats:
    """[3,3] rotation of a quaternion (4,) wxyz of any length but 0."""
    w, x, y, z = quat / np.linalg.norm(quat)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
