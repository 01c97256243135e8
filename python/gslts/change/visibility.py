"""Visibility counts: how many training cameras of a map saw a surface, or saw through it.

Space that no training camera saw cannot have changed, and a surface that most of them saw through
is an error of the map (space carving, Kutulakos and Seitz 2000).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from gslts.change.constants import (
    MAX_PROJECTIONS,
    VISIBILITY_RANGE_M,
    VISIBILITY_WIDTH_PX,
)
from gslts.core.camera import Camera, TrainingCamera, resize
from gslts.core.camera_images import CameraImages
from gslts.core.edited_map import remove_from_id
from gslts.core.gaussian_map import GaussianMap
from gslts.core.surface_margin import surface_margin_m
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.types import Bools, Floats, Floats32, Ints


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

    A `TrainingCamera` saw no farther than what was there at its time: behind a door that was
    closed then, it saw nothing.

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
        cameras = tuple(cameras)
        self._images = CameraImages(resize(camera, VISIBILITY_WIDTH_PX) for camera in cameras)
        self._next_ids = [c.next_id if isinstance(c, TrainingCamera) else None for c in cameras]
        self._depths = np.zeros(self._images.ends[-1], np.float32)
        self._ranges = np.full(self._images.ends[-1], np.inf, np.float32)  # How far each saw.
        self._rendered = np.zeros(len(cameras), np.bool_)

    @property
    def has_cameras(self) -> bool:
        """True if there is any training camera."""
        return len(self._rendered) > 0

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
        return np.array_split(points, 1 + len(points) * len(self._rendered) // MAX_PROJECTIONS)

    def _tests(self, points: Floats) -> tuple[Bools, Bools, Floats]:
        """Return [V,P] seen through, surface seen, and depth, m, of points in cameras."""
        pixels, z = self._images.project(points)
        self._render(np.flatnonzero((pixels > 0).any(axis=1) & ~self._rendered))
        depths, margin = self._depths[pixels], surface_margin_m(z)
        in_range = (z > 0) & (z <= self._ranges[pixels] + margin)
        through = in_range & (depths > z + margin)
        on = in_range & (depths > 0) & (np.abs(depths - z) <= margin)
        return through, on, z

    def _render(self, rows: NDArray[np.intp]) -> None:
        """Render the depth images of some cameras."""
        older, older_than = self._map, None
        for row in rows:
            camera = self._images.cameras[row]
            pixels = slice(self._images.ends[row], self._images.ends[row + 1])
            self._depths[pixels] = self._depth(self._map, camera).ravel()
            next_id = self._next_ids[row]
            if next_id is not None and next_id < self._map.next_id:
                if next_id != older_than:
                    older, older_than = remove_from_id(self._map, next_id), next_id
                seen = _fill_holes(self._depth(older, camera))
                self._ranges[pixels] = seen.ravel()
            self._rendered[row] = True

    def _depth(self, gaussian_map: GaussianMap, camera: Camera) -> Floats32:
        """Return [H,W] the depth of the surfaces that a camera sees, m; 0 where there is none."""
        images = self._rasterizer.forward(gaussian_map, camera, self._options)
        return np.where(images.alpha > 0.5, images.depth, 0).astype(np.float32)


def _fill_holes(depth: Floats32) -> Floats32:
    """Return [H,W] depths with those of the nearest pixel where there are none.

    What was removed since had about the depth of what is around it.
    """
    holes = (depth <= 0).astype(np.uint8)
    if not holes.any() or holes.all():
        return depth
    _, labels = cv2.distanceTransformWithLabels(
        holes, cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL
    )
    by_label = np.zeros(labels.max() + 1, np.float32)
    by_label[labels[holes == 0]] = depth[holes == 0]
    filled: Floats32 = by_label[labels]
    return filled
