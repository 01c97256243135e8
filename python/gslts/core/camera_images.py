"""Images of several cameras in one array, and the pixels at which they see points."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from gslts.core.camera import Camera
from gslts.types import Floats, Ints


class CameraImages:
    """Numbers the pixels of the images of several cameras; 0 stands for outside of an image.

    Args:
        cameras: At their poses in the world, with the sizes of their images.

    Attributes:
        cameras: The same.
        ends: [V+1] of pixel numbers: image k has those from ends[k] to ends[k+1] - 1, row by row.
    """

    def __init__(self, cameras: Iterable[Camera]) -> None:
        self.cameras = tuple(cameras)
        self.ends: Ints = np.cumsum([1, *(c.width * c.height for c in self.cameras)])
        self._camera_from_world = np.array(
            [np.linalg.inv(camera.world_from_camera) for camera in self.cameras]
        ).reshape(-1, 4, 4)
        lenses = [[c.fx, c.fy, c.cx, c.cy] for c in self.cameras]
        self._lenses = np.array(lenses).reshape(-1, 4)
        sizes = [[camera.width, camera.height] for camera in self.cameras]
        self._sizes = np.array(sizes, np.int64).reshape(-1, 2)

    def project(self, points: Floats) -> tuple[Ints, Floats]:
        """Project points into all images.

        Args:
            points: [P,3] world, m.

        Returns:
            [V,P] numbers of the pixels, 0 outside of an image; [V,P] depths in the cameras, m.
        """
        poses = self._camera_from_world
        x, y, z = np.einsum("vij,pj->ivp", poses[:, :3, :3], points) + poses[:, :3, 3].T[..., None]
        fx, fy, cx, cy = self._lenses.T[..., None]
        width, height = self._sizes.T[..., None]
        ahead = np.maximum(z, 1e-9)
        u, v = fx * x / ahead + cx, fy * y / ahead + cy
        inside = (z > 0) & (u >= 0) & (u < width) & (v >= 0) & (v < height)
        columns, rows = (np.where(inside, place, 0).astype(np.int64) for place in (u, v))
        return np.where(inside, self.ends[:-1, None] + rows * width + columns, 0), z
