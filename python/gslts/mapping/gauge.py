"""Gauge of a map: refined poses must not carry the map away as a whole.

A rigid motion of all poses and of the map changes no image, so nothing but the given poses fixes
it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gslts.core.gaussian_map import GaussianMap
from gslts.core.se3 import fit_rigid_motion, rotation_vector
from gslts.mapping.observation import Observation
from gslts.types import Floats


def restore_gauge(gaussian_map: GaussianMap, observations: Sequence[Observation]) -> GaussianMap:
    """Move map and refined poses together so that the poses are nearest to the given ones.

    Args:
        gaussian_map: Map in the frame of the refined poses.
        observations: All training frames; their poses are moved in place.

    Returns:
        The moved map.
    """
    poses = np.array([frame.world_from_camera for frame in observations])
    given = np.array([frame.given_pose for frame in observations])
    from_cameras = gaussian_map.means + (gaussian_map.origin - poses[:, :3, 3].mean(axis=0))
    arm_m = float(np.median(np.linalg.norm(from_cameras, axis=1)))
    motion = fit_rigid_motion(poses, given, arm_m)
    for frame in observations:
        frame.world_from_camera = motion @ frame.world_from_camera
    return move_map(gaussian_map, motion)


def move_map(gaussian_map: GaussianMap, motion: Floats) -> GaussianMap:
    """Return the map after a small rigid motion of the world.

    The rotation must be so small that spherical harmonics need no rotation.

    Args:
        gaussian_map: Of any size.
        motion: [4,4] rigid.
    """
    turn = motion[:3, :3]
    centre = motion[:3, 3] + (turn - np.eye(3)) @ gaussian_map.origin
    half = 0.5 * rotation_vector(turn)
    # To first order a quaternion q turns by (1, half) q.
    w, xyz = gaussian_map.quats[:, :1], gaussian_map.quats[:, 1:]
    quats = np.concatenate([w - xyz @ half[:, None], xyz + w * half + np.cross(half, xyz)], axis=1)
    dtype = gaussian_map.dtype
    means = (gaussian_map.means @ turn.T + centre).astype(dtype)
    return replace(gaussian_map, means=means, quats=quats.astype(dtype))
