"""Visibility counts: how many training cameras of a map saw a surface, or saw through it.

Space that no training camera saw cannot have changed, and a surface that most of them saw through
is an error of the map (space carving, Kutulakos and Seitz 2000).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gslts.change.constants import (
    MAX_PROJECTIONS,
    VISIBILITY_RANGE_M,
    VISIBILITY_WIDTH_PX,
)
from gslts.core.camera import Camera
from gslts.core.gaussian_map import GaussianMap
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.store.measurements import surface_margin_m
from gslts.types import Bools, Floats, Ints


@dataclass(frozen=True, eq=False)
class VisibilityCounts:
    """Numbers of training cameras that saw each of P points.

    Attributes:
        through: [P] cameras that saw through the point, to a surface behind it.
        on: [P] cameras that saw a surface at the point.
    """

    through: Ints
    on: Ints


class Visibility:
    """Tests points against depth images rendered at the training cameras, each when needed.

    Args:
        gaussian_map: float32.
        cameras: Training cameras of the map.
        threads: Number of threads; 0 means one per hardware thread.
    """

    def __init__(
        self, gaussian_map: GaussianMap, cameras: Iterable[Camera], threads: int = 0
    ) -> None:
        self._map, self._options = (
            gaussian_map,
            RenderOptions(far_m=VISIBILITY_RANGE_M, threads=threads),
        )
        self._rasterizer = Rasterizer(np.float32)
        self._cameras = small = [_scale(camera) for camera in cameras]
        # All depth images in one array; the first element stands for pixels outside every image.
        ends = np.cumsum([1, *(camera.width * camera.height for camera in small)])
        self._depths = np.zeros(ends[-1], np.float32)
        self._first = ends[:-1, None]
        self._rendered = np.zeros(len(small), np.bool_)
        self._camera_from_world = np.array(
            [np.linalg.inv(camera.world_from_camera) for camera in small]
        ).reshape(-1, 4, 4)
        lenses = [[camera.fx, camera.fy, camera.cx, camera.cy] for camera in small]
        self._lenses = np.array(lenses).reshape(-1, 4)
        sizes = [[camera.width, camera.height] for camera in small]
        self._sizes = np.array(sizes, np.int64).reshape(-1, 2)

    @property
    def has_cameras(self) -> bool:
        """True if there is any training camera."""
        return len(self._cameras) > 0

    def counts(self, points: Floats, max_depths_m: Floats | None = None) -> VisibilityCounts:
        """Count the training cameras that saw each point.

        Args:
            points: [P,3] world, m.
            max_depths_m: [P] depth of the point in a camera, m, beyond which that does not count;
                None means no limit.
        """
        limits_m = np.full(len(points), np.inf) if max_depths_m is None else max_depths_m
        parts = []
        for part, limit_m in zip(self._parts(points), self._parts(limits_m), strict=True):
            through, on, z = self._tests(part)
            near = z <= limit_m
            parts.append(np.stack([through & near, on & near]).sum(axis=1))
        return VisibilityCounts(*np.concatenate(parts, axis=1))

    def visible(self, points: Floats, max_depth_m: float) -> Bools:
        """Test which training cameras saw a surface at each point.

        Args:
            points: [P,3] world, m.
            max_depth_m: Maximum depth of a point in a camera, m.

        Returns:
            [V,P] True where camera V saw a surface at point P, no farther away.
        """
        tests = map(self._tests, self._parts(points))
        return np.concatenate([on & (z <= max_depth_m) for _, on, z in tests], axis=1)

    def _parts(self, points: Floats) -> list[Floats]:
        """Split points so that the memory does not grow with the number of cameras."""
        return np.array_split(points, 1 + len(points) * len(self._cameras) // MAX_PROJECTIONS)

    def _tests(self, points: Floats) -> tuple[Bools, Bools, Floats]:
        """Return [V,P] seen through, surface seen, and depth, m, of points in cameras."""
        poses = self._camera_from_world
        x, y, z = np.einsum("vij,pj->ivp", poses[:, :3, :3], points) + poses[:, :3, 3].T[..., None]
        fx, fy, cx, cy = self._lenses.T[..., None]
        width, height = self._sizes.T[..., None]
        ahead = np.maximum(z, 1e-9)
        u, v = fx * x / ahead + cx, fy * y / ahead + cy
        inside = (z > 0) & (u >= 0) & (u < width) & (v >= 0) & (v < height)
        self._render(np.flatnonzero(inside.any(axis=1) & ~self._rendered))
        columns, rows = (np.where(inside, place, 0).astype(np.int64) for place in (u, v))
        depths = self._depths[np.where(inside, self._first + rows * width + columns, 0)]
        margin = surface_margin_m(z)
        through = (z > 0) & (depths > z + margin)
        on = (depths > 0) & (np.abs(depths - z) <= margin)
        return through, on, z

    def _render(self, rows: NDArray[np.intp]) -> None:
        """Render the depth images of some cameras."""
        for row in rows:
            images = self._rasterizer.forward(self._map, self._cameras[row], self._options)
            depth = np.where(images.alpha > 0.5, images.depth, 0).ravel()
            first = int(self._first[row, 0])
            self._depths[first : first + len(depth)] = depth
            self._rendered[row] = True


def _scale(camera: Camera) -> Camera:
    """Return the camera of an image of `VISIBILITY_WIDTH_PX` columns."""
    scale = VISIBILITY_WIDTH_PX / camera.width
    return Camera(
        fx=scale * camera.fx,
        fy=scale * camera.fy,
        cx=scale * camera.cx,
        cy=scale * camera.cy,
        width=VISIBILITY_WIDTH_PX,
        height=max(1, round(scale * camera.height)),
        world_from_camera=camera.world_from_camera,
    )
