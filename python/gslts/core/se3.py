"""Rigid transforms SE(3), rotations SO(3), and their small changes.

Sums of this module run in one order: a matrix product of NumPy (OpenBLAS) rounds differently from
processor to processor.
"""

from __future__ import annotations

import numpy as np

from gslts.types import Floats


def transform(b_from_a: Floats, points: Floats) -> Floats:
    """Carry points from one frame into another.

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


def inverse_transform(b_from_a: Floats, points: Floats) -> Floats:
    """Carry points back from frame b into frame a.

    Args:
        b_from_a: [4,4] rigid.
        points: [...,3] in frame b, m.

    Returns:
        [...,3] in frame a, m, float64.
    """
    turn, shift = b_from_a[:3, :3], b_from_a[:3, 3]
    x, y, z = (points[..., i, None] - shift[i] for i in range(3))
    result: Floats = x * turn[0] + y * turn[1] + z * turn[2]
    return result


def product(first: Floats, second: Floats) -> Floats:
    """Multiply two small matrices.

    Args:
        first: [N,K].
        second: [K,M].

    Returns:
        [N,M].
    """
    result: Floats = (first[:, :, None] * second[None]).sum(axis=1)
    return result


def relative(world_from_a: Floats, world_from_b: Floats) -> Floats:
    """Return a_from_b [4,4].

    Args:
        world_from_a: [4,4] rigid.
        world_from_b: [4,4] rigid.
    """
    result = np.eye(4)
    result[:3, :3] = product(world_from_a[:3, :3].T, world_from_b[:3, :3])
    result[:3, 3] = inverse_transform(world_from_a, world_from_b[:3, 3])
    return result


def pose_distance(first: Floats, second: Floats) -> tuple[float, float]:
    """Return the distance (m) and the angle (rad) between two poses.

    Args:
        first: [4,4] rigid.
        second: [4,4] rigid.
    """
    motion = relative(first, second)
    angle_rad = np.arccos(np.clip((np.trace(motion[:3, :3]) - 1) / 2, -1, 1))
    return float(np.linalg.norm(motion[:3, 3])), float(angle_rad)


def se3_retract(world_from_camera: Floats, twist: Floats) -> Floats:
    """Return world_from_camera @ exp(twist), [4,4]; exp is of first order in the translation.

    Args:
        world_from_camera: [4,4] rigid.
        twist: (6,) translation (m) before rotation (rad), both in the camera frame.
    """
    step = np.eye(4)
    step[:3, :3], step[:3, 3] = rotation(twist[3:]), twist[:3]
    return product(world_from_camera, step)


def twist_of(motion: Floats) -> Floats:
    """Return the twist (6,) for which `se3_retract` of the identity is a motion.

    Args:
        motion: [4,4] rigid, with a rotation well below pi.
    """
    return np.concatenate([motion[:3, 3], rotation_vector(motion[:3, :3])])


def rotation(vector_rad: Floats) -> Floats:
    """Return the rotation [3,3] about a vector by its length (Rodrigues' formula).

    Args:
        vector_rad: (3,) axis times angle, rad.
    """
    angle = _length(vector_rad)
    if angle == 0:
        return np.eye(3)
    x, y, z = vector_rad / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    result: Floats = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * product(cross, cross)
    return result


def rotation_vector(turn: Floats) -> Floats:
    """Return the vector (3,), rad, of which `rotation` makes a rotation.

    Args:
        turn: [3,3] rotation by an angle well below pi.
    """
    axis = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    sine, cosine = 0.5 * _length(axis), 0.5 * (float(np.trace(turn)) - 1)
    angle = np.arctan2(sine, cosine)
    result: Floats = axis * (0.5 if sine < 1e-9 else 0.5 * angle / sine)
    return result


def rotation_of_quat(quat: Floats) -> Floats:
    """Return the rotation [3,3] of a quaternion.

    Args:
        quat: (4,) wxyz, of any length but 0.
    """
    w, x, y, z = quat / np.linalg.norm(quat)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def quats_of_rotations(turns: Floats) -> Floats:
    """Return the unit quaternions [N,4] wxyz of rotations (Shepperd 1978).

    Args:
        turns: [N,3,3].
    """
    xx, yy, zz = turns[:, 0, 0], turns[:, 1, 1], turns[:, 2, 2]
    # 4 q q^T: each of its rows is a multiple of the quaternion, and the longest is exact.
    w = [1 + xx + yy + zz, turns[:, 2, 1] - turns[:, 1, 2], turns[:, 0, 2] - turns[:, 2, 0]]
    w.append(turns[:, 1, 0] - turns[:, 0, 1])
    xy, xz, yz = (turns[:, i, j] + turns[:, j, i] for i, j in ((0, 1), (0, 2), (1, 2)))
    outer = np.stack(
        [
            np.stack(w, axis=1),
            np.stack([w[1], 1 + xx - yy - zz, xy, xz], axis=1),
            np.stack([w[2], xy, 1 - xx + yy - zz, yz], axis=1),
            np.stack([w[3], xz, yz, 1 - xx - yy + zz], axis=1),
        ],
        axis=1,
    )
    longest = np.einsum("nii->ni", outer).argmax(axis=1)
    quats = outer[np.arange(len(outer)), longest]
    return np.asarray(quats / np.linalg.norm(quats, axis=1, keepdims=True))


def fit_rigid_motion(poses: Floats, given: Floats, arm_m: float) -> Floats:
    """Fit the rigid motion of the world that brings poses nearest to given ones.

    Args:
        poses: [F,4,4] world_from_camera.
        given: [F,4,4] world_from_camera.
        arm_m: Typical distance from a camera to the surfaces it sees, m: it weighs rotations
            against translations.

    Returns:
        [4,4] motion; motion @ poses are nearest to `given` in least squares.

    Source: Kabsch 1976, on the centres of the cameras and the ends of their axes of length arm_m.
    """
    ends = np.hstack([arm_m * np.vstack([np.zeros(3), np.eye(3)]), np.ones((4, 1))]).T
    start, end = ((some @ ends)[:, :3].transpose(0, 2, 1).reshape(-1, 3) for some in (poses, given))
    centres = start.mean(axis=0), end.mean(axis=0)
    u, _, v = np.linalg.svd((start - centres[0]).T @ (end - centres[1]))
    turn = (u @ np.diag([1, 1, np.sign(np.linalg.det(u @ v))]) @ v).T
    motion = np.eye(4)
    motion[:3, :3], motion[:3, 3] = turn, centres[1] - turn @ centres[0]
    return motion


def _length(vector: Floats) -> float:
    return float(np.sqrt((vector * vector).sum()))
