"""Small depth images of the recording of a map: where it measured a surface, drawn or not."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gslts.core.camera import Camera, resize
from gslts.core.camera_images import CameraImages
from gslts.core.frame import RgbdFrame
from gslts.types import Bools, Floats, Floats32, Ints

WIDTH_PX = 80
"""Width of the images: a pixel is about 4 cm at 3 m, and 200 images take 2 MB."""
MARGIN_M, MARGIN_SHARE = 0.0075, 0.005
"""A point within so many m, plus so much of its depth, of a measured one is on its surface: about
the noise of a depth camera. A book that comes to a table is outside of it."""
MM_PER_M = 1000.0
"""Depths are stored in mm."""
KEYS = ("depth_poses", "depth_lenses", "depth_sizes", "depths_mm")
"""Names of the arrays in a file."""


@dataclass(frozen=True, eq=False)
class RecordedCounts:
    """Numbers of images that measured a surface in the direction of each of P points.

    Attributes:
        before: [P] before the point, which is hidden.
        on: [P] at the point.
        behind: [P] behind the point: it was free.
    """

    before: Ints
    on: Ints
    behind: Ints


@dataclass(frozen=True, eq=False)
class RecordedDepths:
    """Depth images of frames, at their poses in the map.

    Args:
        cameras: Of the images.
        depths_mm: [P] measured depths of all images, one after the other and row by row, mm; 0
            where nothing was measured.

    Raises:
        ValueError: The sizes of the images do not fit the depths.
    """

    cameras: tuple[Camera, ...]
    depths_mm: NDArray[np.uint16]

    def __post_init__(self) -> None:
        pixels = sum(camera.width * camera.height for camera in self.cameras)
        if self.depths_mm.dtype != np.uint16 or self.depths_mm.shape != (pixels,):
            raise ValueError(
                f"RecordedDepths: depths_mm: expected uint16 ({pixels},), got "
                f"{self.depths_mm.dtype} {self.depths_mm.shape}"
            )

    @cached_property
    def _images(self) -> CameraImages:
        return CameraImages(self.cameras)

    @cached_property
    def _measured_m(self) -> Floats32:
        """Return the depths by the number of the pixel; 0 outside of the images."""
        return np.append(np.float32(0), self.depths_mm / np.float32(MM_PER_M))

    def counts(self, points: Floats) -> RecordedCounts:
        """Count the images that measured a surface at each point, before and behind it.

        Args:
            points: [P,3] world, m; P times the number of images bounds the memory.
        """
        pixels, z = self._images.project(points)
        measured_m = self._measured_m[pixels]
        is_known, margin_m = measured_m > 0, MARGIN_M + MARGIN_SHARE * z
        return RecordedCounts(
            before=_count(is_known & (measured_m < z - margin_m)),
            on=_count(is_known & (np.abs(measured_m - z) <= margin_m)),
            behind=_count(is_known & (measured_m > z + margin_m)),
        )

    def extended(self, by: RecordedDepths) -> RecordedDepths:
        """Return these images and others.

        Args:
            by: The others.
        """
        return RecordedDepths(
            self.cameras + by.cameras, np.concatenate([self.depths_mm, by.depths_mm])
        )

    def to_arrays(self) -> dict[str, NDArray[Any]]:
        """Return the arrays that `from_arrays` reads, by name."""
        lenses = [[c.fx, c.fy, c.cx, c.cy] for c in self.cameras]
        sizes = [[camera.width, camera.height] for camera in self.cameras]
        arrays = (
            np.array([c.world_from_camera for c in self.cameras], np.float64).reshape(-1, 4, 4),
            np.array(lenses, np.float64).reshape(-1, 4),
            np.array(sizes, np.int64).reshape(-1, 2),
            self.depths_mm,
        )
        return dict(zip(KEYS, arrays, strict=True))

    @staticmethod
    def from_arrays(arrays: Mapping[str, NDArray[Any]]) -> RecordedDepths:
        """Read the arrays of `to_arrays`; maps of older versions have none.

        Args:
            arrays: By name.

        Raises:
            KeyError: Some are missing.
            ValueError: They do not fit together, or a camera is invalid.
        """
        if not any(key in arrays for key in KEYS):
            return NO_RECORDED_DEPTHS
        poses, lenses, sizes, depths_mm = (arrays[key] for key in KEYS)
        cameras = tuple(
            Camera(
                **dict(zip(("fx", "fy", "cx", "cy"), lens.tolist(), strict=True)),
                **dict(zip(("width", "height"), size.tolist(), strict=True)),
                world_from_camera=pose,
            )
            for pose, lens, size in zip(poses, lenses, sizes, strict=True)
        )
        return RecordedDepths(cameras, depths_mm)


NO_RECORDED_DEPTHS = RecordedDepths((), np.zeros(0, np.uint16))
"""Of maps without a recording, or without depth."""


def _count(marks: Bools) -> Ints:
    """Return [P] the number of images [V,P] with a mark."""
    return np.asarray(marks.sum(axis=0), np.int64)


def small_depth_image(frame: RgbdFrame) -> tuple[Camera, NDArray[np.uint16]]:
    """Return the camera and the depths of a small image of a frame.

    A depth is that of the middle of a small pixel: the mean of two surfaces is on neither.

    Args:
        frame: Registered, at its pose in the map.

    Returns:
        The camera; [P] depths, mm, row by row, 0 where nothing was measured.
    """
    camera = resize(frame.camera, WIDTH_PX)
    rows, columns = (
        ((np.arange(few) + 0.5) * many / few).astype(np.intp)
        for few, many in zip((camera.height, camera.width), frame.depth.shape, strict=True)
    )
    pixels = np.ix_(rows, columns)
    depths_mm = np.round(MM_PER_M * np.nan_to_num(frame.depth[pixels], posinf=0.0))
    is_known = (depths_mm > 0) & (depths_mm <= np.iinfo(np.uint16).max)
    if frame.mask is not None:
        is_known &= frame.mask[pixels]
    return camera, np.where(is_known, depths_mm, 0).astype(np.uint16).ravel()
