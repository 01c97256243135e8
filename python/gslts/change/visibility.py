"""Where the frames that a map was made from have looked.

What none of them saw cannot have changed, and what most of them looked through is no surface of the
room but an error of the map.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gslts.core.camera import Camera
from gslts.core.gaussian_map import GaussianMap
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.types import Bools, Floats

WIDTH_PX = 160
"""Of the depth images that are kept."""
MOST_LOOKS = 1 << 18
"""From cameras at points, at a time."""
MARGIN_M, MARGIN_SHARE = 0.03, 0.02
"""Within so much of a surface, and by so much of its depth more, a point is on it."""


@dataclass(frozen=True, eq=False)
class Sights:
    """How points [P] look from where a map was made.

    Attributes:
        through: How many frames looked through a point.
        on: How many saw a surface there.
    """

    through: NDArray[np.int64]
    on: NDArray[np.int64]


class SeenSpace:
    """Depth of a map from where it was made, which is rendered where a point is asked about.

    Args:
        gaussian_map: float32.
        cameras: Of the frames that it was made from.
        threads: 0 means one a hardware thread.
    """

    def __init__(
        self, gaussian_map: GaussianMap, cameras: Iterable[Camera], threads: int = 0
    ) -> None:
        self._map, self._options = gaussian_map, RenderOptions(threads=threads)
        self._rasterizer = Rasterizer(np.float32)
        self._cameras = small = [_shrunk(camera) for camera in cameras]
        ends = np.cumsum([1, *(one.width * one.height for one in small)])
        self._depths = np.zeros(ends[-1], np.float32)
        self._first = ends[:-1, None]
        self._rendered = np.zeros(len(small), np.bool_)
        self._camera_from_world = np.array(
            [np.linalg.inv(camera.world_from_camera) for camera in small]
        ).reshape(-1, 4, 4)
        self._lenses = np.array([[one.fx, one.fy, one.cx, one.cy] for one in small]).reshape(-1, 4)
        self._sizes = np.array([[one.width, one.height] for one in small], np.int64)
        self._sizes = self._sizes.reshape(-1, 2)

    @property
    def is_known(self) -> bool:
        """Whether there is any camera."""
        return len(self._lenses) > 0

    def sights(self, points: Floats) -> Sights:
        """How points [P,3] (world, m) look from all cameras."""
        counts = [
            (through.sum(axis=0), on.sum(axis=0))
            for through, on, _ in map(self._looks, self._parts(points))
        ]
        through, on = (np.concatenate(one) for one in zip(*counts, strict=True))
        return Sights(through, on)

    def shown(self, points: Floats, farthest_m: float) -> Bools:
        """[V,P] which points [P,3] (world, m) are on a surface that each camera sees that near."""
        looks = map(self._looks, self._parts(points))
        return np.concatenate([on & (z <= farthest_m) for _, on, z in looks], axis=1)

    def _parts(self, points: Floats) -> list[Floats]:
        """Points a few at a time: a map that lives has ever more cameras."""
        return np.array_split(points, 1 + len(points) * len(self._lenses) // MOST_LOOKS)

    def _looks(self, points: Floats) -> tuple[Bools, Bools, Floats]:
        """[V,P] whether a camera looks through a point, sees it, and in which depth it is, m."""
        moves = self._camera_from_world
        x, y, z = np.einsum("vij,pj->ivp", moves[:, :3, :3], points) + moves[:, :3, 3].T[..., None]
        fx, fy, cx, cy = self._lenses.T[..., None]
        width, height = self._sizes.T[..., None]
        ahead = np.maximum(z, 1e-9)
        u, v = fx * x / ahead + cx, fy * y / ahead + cy
        inside = (z > 0) & (u >= 0) & (u < width) & (v >= 0) & (v < height)
        self._render(np.flatnonzero(inside.any(axis=1) & ~self._rendered))
        columns, rows = (np.where(inside, one, 0).astype(np.int64) for one in (u, v))
        # Nothing is at a depth of 0: the first number is that of all that is outside.
        depths = self._depths[np.where(inside, self._first + rows * width + columns, 0)]
        margin = MARGIN_M + MARGIN_SHARE * z
        through = (z > 0) & (depths > z + margin)
        on = (depths > 0) & (np.abs(depths - z) <= margin)
        return through, on, z

    def _render(self, views: NDArray[np.intp]) -> None:
        for view in views:
            images = self._rasterizer.forward(self._map, self._cameras[view], self._options)
            depth = np.where(images.alpha > 0.5, images.depth, 0).ravel()
            first = int(self._first[view, 0])
            self._depths[first : first + len(depth)] = depth
            self._rendered[view] = True


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
