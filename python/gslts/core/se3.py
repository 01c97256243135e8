"""Small changes of a camera's pose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gslts.core.camera import rotation_vector
from gslts.core.gaussian_map import GaussianMap
from gslts.types import Floats


def anchoring(poses: Floats, given: Floats, arm_m: float) -> Floats:
    """[4,4] the motion of the world that brings poses nearest to the given ones.

    Corrections of single poses must not add up to a motion of the map as a whole, which no picture
    tells from none at all.

    Args:
        poses: [F,4,4].
        given: [F,4,4].
        arm_m: About how far away what the cameras see is: a turn moves it by so much more than the
            cameras.

    Source: Kabsch 1976, over the cameras' centres and the ends of their axes, so long.
    """
    ends = np.hstack([arm_m * np.vstack([np.zeros(3), np.eye(3)]), np.ones((4, 1))]).T
    start, end = ((some @ ends)[:, :3].transpose(0, 2, 1).reshape(-1, 3) for some in (poses, given))
    centres = start.mean(axis=0), end.mean(axis=0)
    u, _, v = np.linalg.svd((start - centres[0]).T @ (end - centres[1]))
    turn = (u @ np.diag([1, 1, np.sign(np.linalg.det(u @ v))]) @ v).T
    motion = np.eye(4)
    motion[:3, :3], motion[:3, 3] = turn, centres[1] - turn @ centres[0]
    return motion


def moved_map(gaussian_map: GaussianMap, motion: Floats) -> GaussianMap:
    """The map after a rigid motion [4,4] of the world, by angles so small that harmonics stay."""
    turn = motion[:3, :3]
    centre = motion[:3, 3] + (turn - np.eye(3)) @ gaussian_map.origin
    half = 0.5 * rotation_vector(turn)
    # To first order a quaternion q turns by (1, half) q.
    w, xyz = gaussian_map.quats[:, :1], gaussian_map.quats[:, 1:]
    quats = np.concatenate([w - xyz @ half[:, None], xyz + w * half + np.cross(half, xyz)], axis=1)
    dtype = gaussian_map.dtype
    means = (gaussian_map.means @ turn.T + centre).astype(dtype)
    return replace(gaussian_map, means=means, quats=quats.astype(dtype))
