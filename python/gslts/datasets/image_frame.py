"""Frames stored as image files."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gslts.core.camera import Camera
from gslts.core.frame import Labels, RgbdFrame
from gslts.datasets.undistort import Lens, undistort_depth, undistort_rgb
from gslts.io.image_files import read_integers, read_rgb


@dataclass(frozen=True, eq=False)
class ImageFrame:
    """A frame stored as image files.

    Args:
        rgb: Colour image, in a format of `SIGNATURES`.
        camera: Intrinsics and pose of the colour image.
        depth: 16-bit image of z in the camera frame; None without depth.
        depth_unit_m: Metres of one step of the depth image.
        depth_invalid: Value besides 0 that means no measurement; None if there is none.
        time_s: Time stamp, s.
        depth_camera: Intrinsics and pose of the depth image; None if it is registered.
        lens: Distortion of all images, undone when the frame is read; None for a pinhole. Then
            there is no border.
        confidence: 8-bit image of the size of the depth image; where it is 0, depth is dropped.
        border_px: Width of a border of the colour image that is not used, such as the black one
            that undistortion leaves.
        instances: 16-bit image: 1 + index of the object in `types`, 0 for no object; None without
            labels. An undistorted image keeps no labels.
        types: Types of the objects, such as "Mug".
        mask: Grey image of the size of the colour image; where it is 0, nothing is used.
        longer_name: Unique name where the name of the file is not unique; else "".
    """

    rgb: Path
    camera: Camera
    depth: Path | None = None
    depth_unit_m: float = 0.001
    depth_invalid: int | None = None
    time_s: float = 0.0
    depth_camera: Camera | None = None
    lens: Lens | None = None
    confidence: Path | None = None
    border_px: int = 0
    instances: Path | None = None
    types: tuple[str, ...] = ()
    mask: Path | None = None
    longer_name: str = ""

    @property
    def name(self) -> str:
        """Name of the colour image without its ending, or `longer_name`."""
        return self.longer_name or self.rgb.stem

    def read(self) -> RgbdFrame:
        """Read the images; see `Frame.read`."""
        size = (self.camera.height, self.camera.width)
        labels = None if self.instances is None or self.lens is not None else self._labels(size)
        rgb = read_rgb(self.rgb, size)
        mask = None
        if self.lens is not None:
            rgb, mask = undistort_rgb(rgb, self.camera, self.lens)
        elif self.border_px:
            mask = np.zeros(size, np.bool_)
            mask[self.border_px : -self.border_px, self.border_px : -self.border_px] = True
        if self.mask is not None:
            used = self._read_mask(self.mask, size)
            mask = used if mask is None else mask & used
        if self.depth is None:
            depth = np.zeros(size, np.float32)
            return RgbdFrame(rgb, depth, self.camera, self.time_s, None, mask, labels)
        beside = self.camera if self.depth_camera is None else self.depth_camera
        depth_size = (beside.height, beside.width)
        steps = read_integers(self.depth, depth_size)
        depth = (steps * self.depth_unit_m).astype(np.float32)
        depth[(steps <= 0) | (steps == self.depth_invalid)] = 0
        if self.confidence is not None:
            depth[read_integers(self.confidence, depth_size) == 0] = 0
        if self.lens is not None:
            depth = undistort_depth(depth, beside, self.lens)
        return RgbdFrame(rgb, depth, self.camera, self.time_s, self.depth_camera, mask, labels)

    def _read_mask(self, path: Path, size: tuple[int, int]) -> NDArray[np.bool_]:
        """Return the pixels that are used."""
        used = np.asarray(read_integers(path, size) != 0)
        if self.lens is None:
            return used
        return undistort_depth(used.astype(np.float32), self.camera, self.lens) > 0

    def _labels(self, size: tuple[int, int]) -> Labels:
        assert self.instances is not None
        rows = read_integers(self.instances, size).astype(np.int32) - 1
        try:
            return Labels(rows, self.types)
        except ValueError as error:
            raise ValueError(f"{self.instances}: {error}") from None


def with_unique_names(frames: Iterable[ImageFrame], folder: Path) -> tuple[ImageFrame, ...]:
    """Return frames whose names are unique: their path in the folder where file names repeat.

    Args:
        frames: Frames of one data set.
        folder: Folder of the data set.

    Returns:
        The frames in the same order; only frames of the same image file still share a name.
    """
    named = tuple(frames)
    for with_ending in (False, True):
        counts = Counter(frame.name for frame in named)
        named = tuple(
            replace(frame, longer_name=_path_in(folder, frame.rgb, with_ending))
            if counts[frame.name] > 1
            else frame
            for frame in named
        )
    return named


def _path_in(folder: Path, file: Path, with_ending: bool) -> str:
    path = os.path.relpath(file if with_ending else file.with_suffix(""), folder)
    return Path(path).as_posix()
