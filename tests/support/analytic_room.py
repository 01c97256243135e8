"""A room of three textured planes that can be looked at exactly, in double precision."""

import numpy as np

from gslts.core.camera import Camera

NORMALS = np.array([[0.0, 0, 1], [-1, 0, 0], [0, -1, 0]])
OFFSETS = np.array([0.0, -3, -3])  # Floor z = 0, walls x = 3 and y = 3.
FREQUENCIES = np.array([[3.0, 1, 2], [-2, 4, 1], [1, 2, -3], [5, -3, 4]])


def observe(camera: Camera) -> tuple[np.ndarray, np.ndarray]:
    """[H,W,3] colours and [H,W] depth, m, through the centres of the pixels."""
    rows, columns = np.indices((camera.height, camera.width)) + 0.5
    x, y = (columns - camera.cx) / camera.fx, (rows - camera.cy) / camera.fy
    pose = camera.world_from_camera
    rays = np.stack([x, y, np.ones_like(x)], axis=-1) @ pose[:3, :3].T
    with np.errstate(divide="ignore"):
        distances = (OFFSETS - NORMALS @ pose[:3, 3]) / (rays @ NORMALS.T)
    depth = np.where(distances > 0, distances, np.inf).min(axis=-1)
    points = pose[:3, 3] + depth[..., None] * rays
    waves = np.sin(points @ FREQUENCIES.T + np.arange(4))
    rgb = 0.5 + 0.2 * np.stack(
        [waves[..., 0] + waves[..., 1], waves[..., 1] + waves[..., 2], waves[..., 3]], axis=-1
    )
    return rgb, depth
