"""Where the frames that a map was made from have looked: what nobody saw cannot have changed."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from gslts.camera import Camera
from gslts.gaussian_map import GaussianMap
from gslts.render import Rasterizer, RenderOptions

Floats = NDArray[np.float64]

WIDTH_PX = 80
"""Of the depth images that are kept."""
MARGIN_M = 0.05
"""What stands nearer to a surface was not seen to be empty."""


class SeenSpace:
    """Depth of a map from where it was made.

    Args:
        gaussian_map: float32.
        cameras: Of the frames that it was made from.
        threads: 0 means one a hardware thread.
    """

    def __init__(
        self, gaussian_map: GaussianMap, cameras: Iterable[Camera], threads: int = 0
    ) -> None:
        rasterizer, options = Rasterizer(np.float32), RenderOptions(threads=threads)
        self._views: list[tuple[Camera, NDArray[np.float32]]] = []
        for camera in cameras:
            small = _shrunk(camera)
            images = rasterizer.forward(gaussian_map, small, options)
            self._views.append((small, np.where(images.alpha > 0.5, images.depth, 0)))

    def free_share(self, points: Floats) -> float:
        """Share of points [P,3] (world, m) that a camera looked through, so that nothing was there.

        It is 1 if nothing is known about the cameras.
        """
        if not self._views:
            return 1.0
        free = np.zeros(len(points), np.bool_)
        for camera, depth in self._views:
            turn, place = camera.world_from_camera[:3, :3], camera.world_from_camera[:3, 3]
            x, y, z = ((points - place) @ turn).T
            ahead = z > MARGIN_M
            u = np.where(ahead, camera.fx * x / np.where(ahead, z, 1) + camera.cx, -1)
            v = np.where(ahead, camera.fy * y / np.where(ahead, z, 1) + camera.cy, -1)
            inside = (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
            rows, columns = v[inside].astype(np.int64), u[inside].astype(np.int64)
            free[inside] |= depth[rows, columns] > z[inside] + MARGIN_M
        return float(free.mean())


def _shrunk(camera: Camera) -> Camera:
    scale = WIDTH_PX / camera.width
    return Camera(
        fx=scale * camera.fx,
        fy=scale * camera.fy,
        cx=scale * camera.cx,
        cy=scale * camera.cy,
        width=WIDTH_PX,
        height=max(1, round(scale * camera.height)),
        world_from_camera=camera.world_from_camera,
    )
