"""Worlds with z up, by the cameras and the floor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gslts.core.camera import Camera, unproject
from gslts.core.frame import RgbdFrame
from gslts.core.se3 import product, transform
from gslts.datasets.dataset import Dataset
from gslts.datasets.posed import with_poses
from gslts.trajectory.constants import (
    MAX_TILT_RAD,
    MAX_UP_FRAMES,
    MEAN_UP_WEIGHT,
    MIN_SPREAD,
    NORMAL_RADIUS_M,
    PHONE_WEIGHT,
    UP_CONES_RAD,
    UP_DIRECTIONS,
    UP_STRIDE_PX,
    UP_VOXEL_M,
)
from gslts.trajectory.open3d import import_open3d
from gslts.types import Floats


def describe_tilt(cameras: Sequence[Camera]) -> str:
    """Tell if z is not up in a world, by its cameras.

    Args:
        cameras: Of a recording or a map.

    Returns:
        Such as "z is not up here: up is (0.0, -1.0, 0.1)"; empty if z may be up.
    """
    if not cameras:
        return ""
    up = up_of(np.array([camera.world_from_camera for camera in cameras]), np.eye(3)[2])
    if up[2] >= np.cos(MAX_TILT_RAD):
        return ""
    return f"z is not up here: up is ({', '.join(f'{number:.1f}' for number in up.round(1) + 0.0)})"


def turn_upright(dataset: Dataset) -> Dataset:
    """Turn the poses of a recording to a world with z up.

    Args:
        dataset: With poses.

    Returns:
        The recording in a world whose origin is the first camera, which looks along x.

    Raises:
        ImportError: Open3D is missing.
        OSError: A frame cannot be read.
        ValueError: There is no frame, or one is damaged.
    """
    if not dataset.frames:
        raise ValueError(f"{dataset.name}: there is no frame with a pose")
    step = -(-len(dataset.frames) // MAX_UP_FRAMES)
    points = np.concatenate([_points_of(frame.read()) for frame in dataset.frames[::step]])
    given = {frame.name: frame.camera.world_from_camera for frame in dataset.frames}
    motion = upright_world(np.array(list(given.values())), points)
    turned = with_poses(dataset, {name: product(motion, pose) for name, pose in given.items()})
    if dataset.points is None:
        return turned
    moved = transform(motion, dataset.points.points)
    return replace(turned, points=replace(dataset.points, points=moved))


def upright_world(cameras: Floats, points: Floats) -> Floats:
    """Return the motion to a world with z up, whose origin is the first camera.

    People and robots hold cameras level, in landscape or portrait: one side of the image is
    horizontal, nearly. Floors and tables tell the rest.

    Args:
        cameras: [K,4,4] world_from_camera, m, at least one.
        points: [P,3] of the scene in the world, m, dense enough for normals; may be empty.

    Returns:
        [4,4] upright_from_world; the first camera looks along x, as far as it does not look up.
    """
    up = up_of(cameras)
    normals = _normals(points) if len(points) else points
    normals *= np.where(normals @ up < 0, -1, 1)[:, None]
    for cone_rad in UP_CONES_RAD:
        near = normals[normals @ up > np.cos(cone_rad)]
        if len(near):
            up = near.mean(axis=0)
            up /= np.linalg.norm(up)
    return _frame_of(up, cameras[0])


def _points_of(frame: RgbdFrame) -> Floats:
    """Return points [P,3] of the depth image of a frame, in the world, m."""
    depth = frame.depth[::UP_STRIDE_PX, ::UP_STRIDE_PX]
    pixels = np.argwhere(depth > 0)
    camera = frame.camera if frame.depth_camera is None else frame.depth_camera
    centers = (UP_STRIDE_PX * pixels[:, ::-1] + 0.5).astype(np.float64)
    return unproject(camera, centers, depth[depth > 0].astype(np.float64))


def up_of(cameras: Floats, likely: Floats | None = None) -> Floats:
    """Return the upward axis (3,), orthogonal to the horizontal axes of images if these differ.

    It minimizes the sum of (h u)^2, h the horizontal axis of an image, and of a small share of
    (u - m)^2, m the mean upward axis of the images.

    Args:
        cameras: [K,4,4] world_from_camera, m, at least one.
        likely: (3,) upward axis, up to 90 degrees, if known: in portrait, either short side may be
            up. By default, it is that of views downwards, or of phones.
    """
    level, upward = _axes_of_images(cameras, likely)
    weights = level.T @ level / len(level) + MEAN_UP_WEIGHT * np.eye(3)
    up = np.linalg.solve(weights, upward.mean(axis=0))
    return np.asarray(up / np.linalg.norm(up))


def _axes_of_images(cameras: Floats, likely: Floats | None) -> tuple[Floats, Floats]:
    """Return the horizontal and the upward axes [K,3] of images in landscape or portrait.

    In a recording in portrait, y axes are spread in a plane, and x axes are not. Up is about the
    direction to which x or y axes are orthogonal, and views nearly.
    """

    def cost_of(poses: Floats, up: Floats) -> tuple[Floats, Floats]:
        along = (poses[:, :3, :3].transpose(2, 0, 1) @ up.T) ** 2
        views = MEAN_UP_WEIGHT * along[2]
        return along[0] + views, along[1] + views + MEAN_UP_WEIGHT * MIN_SPREAD

    directions = _hemisphere(UP_DIRECTIONS)
    some = cameras[:: -(-len(cameras) // MAX_UP_FRAMES)]
    costs = np.minimum(*cost_of(some, directions)).mean(axis=0)
    up = directions[costs.argmin()]
    landscape, portrait = cost_of(cameras, up)
    is_portrait = (portrait < landscape)[:, None]
    x, y, z = cameras[:, :3, :3].transpose(2, 0, 1)
    down_in_portrait = z + PHONE_WEIGHT * x if likely is None else -likely
    if (np.where(is_portrait, down_in_portrait, y) @ up).sum() > 0:
        up = -up
    in_portrait = np.where((x @ up < 0)[:, None], -x, x)
    return np.where(is_portrait, y, x), np.where(is_portrait, in_portrait, -y)


def _hemisphere(count: int) -> Floats:
    """Return directions [N,3], spread evenly, no two of them opposite (a Fibonacci lattice)."""
    z = (np.arange(count) + 0.5) / count
    turn_rad = np.pi * (1 + np.sqrt(5)) * np.arange(count)
    across = np.sqrt(1 - z**2)
    return np.stack([across * np.cos(turn_rad), across * np.sin(turn_rad), z], axis=1)


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
