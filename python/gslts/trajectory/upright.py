"""World frame of an estimated trajectory: z up, by the cameras and the floor."""

from __future__ import annotations

import numpy as np

from gslts.trajectory.constants import MEAN_UP_WEIGHT, NORMAL_RADIUS_M, UP_CONES_RAD, UP_VOXEL_M
from gslts.trajectory.open3d import import_open3d
from gslts.types import Floats


def upright_world(cameras: Floats, points: Floats) -> Floats:
    """Return the motion to a world with z up, whose origin is the first camera.

    People and robots hold cameras level: their x axes are horizontal, nearly. Floors and tables
    tell the rest.

    Args:
        cameras: [K,4,4] world_from_camera, m, at least one.
        points: [P,3] of the scene in the world, m, dense enough for normals; may be empty.

    Returns:
        [4,4] upright_from_world; the first camera looks along x, as far as it does not look up.
    """
    up = _up_of(cameras)
    normals = _normals(points) if len(points) else points
    normals *= np.where(normals @ up < 0, -1, 1)[:, None]
    for cone_rad in UP_CONES_RAD:
        near = normals[normals @ up > np.cos(cone_rad)]
        if len(near):
            up = near.mean(axis=0)
            up /= np.linalg.norm(up)
    return _frame_of(up, cameras[0])


def _up_of(cameras: Floats) -> Floats:
    """Return the upward axis (3,) that is orthogonal to the x axes of cameras, where these differ.

    It minimizes the sum of (x u)^2 and of a small share of |u - m|^2, m the mean upward axis.
    """
    x = cameras[:, :3, 0]
    mean_up = -cameras[:, :3, 1].mean(axis=0)
    up = np.linalg.solve(x.T @ x / len(x) + MEAN_UP_WEIGHT * np.eye(3), mean_up)
    return np.asarray(up / np.linalg.norm(up))


def _normals(points: Floats) -> Floats:
    """Return unit normals [N,3] of either sign, of the points in voxels."""
    o3d = import_open3d()
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
    cloud = cloud.voxel_down_sample(UP_VOXEL_M)
    cloud.estimate_normals(o3d.geometry.KDTreeSearchParamRadius(NORMAL_RADIUS_M))
    normals: Floats = np.asarray(cloud.normals, np.float64).reshape(-1, 3)
    has_neighbours = (normals != (0, 0, 1)).any(axis=1)  # Open3D's value without.
    known: Floats = normals[has_neighbours]
    return known


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
