"""Gauge of a map: free poses must not carry the map away as a whole."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gslts.core.gaussian_map import GaussianMap
from gslts.core.se3 import rotation_vector
from gslts.types import Floats


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
