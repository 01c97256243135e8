"""World frame of an estimated trajectory: z up, by the cameras and the floor."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gslts.core.se3 import transform
from gslts.trajectory.constants import NORMAL_RADIUS_M, UP_CONES_RAD, UP_VOXEL_M
from gslts.trajectory.open3d import import_open3d
from gslts.types import Floats, Floats32


def upright_world(poses: Mapping[int, Floats], clouds: Mapping[int, Floats32]) -> Floats:
    """Return the motion to a world with z up, whose origin is the first camera.

    People and robots hold cameras nearly upright; floors and tables tell the rest.

    Args:
        poses: World_from_camera [4,4] of keyframes, m.
        clouds: Points [P,3] of the same keyframes in their camera frames, m.

    Returns:
        [4,4] upright_from_world; the first camera looks along x, as far as it does not look up.
    """
    cameras = np.array(list(poses.values()))
    up = -cameras[:, :3, 1].mean(axis=0)
    up /= np.linalg.norm(up)
    points = np.concatenate([transform(poses[k], clouds[k].astype(np.float64)) for k in poses])
    normals = _normals(points)
    normals *= np.where(normals @ up < 0, -1, 1)[:, None]
    for cone_rad in UP_CONES_RAD:
        near = normals[normals @ up > np.cos(cone_rad)]
        if len(near):
            up = near.mean(axis=0)
            up /= np.linalg.norm(up)
    return _frame_of(up, cameras[0])


def _normals(points: Floats) -> Floats:
    """Return unit normals [N,3] of either sign, of the points in voxels."""
    o3d = import_open3d()
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud = cloud.voxel_down_sample(UP_VOXEL_M)
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamRadius(NORMAL_RADIUS_M))
    return np.asarray(cloud.normals, np.float64).reshape(-1, 3)


def _frame_of(up: Floats, first: Floats) -> Floats:
    """Return the motion [4,4] to axes with z along `up` and x along the view of a camera."""
    forward = first[:3, 2] - (first[:3, 2] @ up) * up
    if np.linalg.norm(forward) < 1e-3:  # It looks straight up or down.
        forward = first[:3, 0] - (first[:3, 0] @ up) * up
    x = forward / np.linalg.norm(forward)
    motion = np.eye(4)
    motion[:3, :3] = np.stack([x, np.cross(up, x), up])
    motion[:3, 3] = -motion[:3, :3] @ first[:3, 3]
    return motion
