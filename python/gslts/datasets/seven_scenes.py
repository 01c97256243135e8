"""7-Scenes (Shotton et al. 2013): frame-N.color, .depth.png and .pose.txt in one folder.

Without any .pose.txt, frames have no pose.

The images come from a Kinect without registration: the poses, found by KinectFusion, are those of
the depth camera.

Scans of BundleFusion (Dai et al. 2017) have the same images and poses, and `info.txt` with the
intrinsics of both cameras, which both have the pose of the frame, as in ScanNet.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, FiniteFloat, ValidationError
from pydantic.alias_generators import to_camel

from gslts.core.camera import Camera
from gslts.datasets.dataset import (
    MAX_MATRIX_BYTES,
    MAX_SIDE_PX,
    Dataset,
    gather,
    name_of,
    pinhole,
    read_numbers,
    resize_camera,
    rigid,
)
from gslts.datasets.files import MissingImageError
from gslts.datasets.image_frame import ImageFrame
from gslts.datasets.scannet import scannet_camera
from gslts.io.bounded_files import read_bounded
from gslts.io.image_files import image_size
from gslts.io.messages import first_problem
from gslts.types import Floats

NO_DEPTH = 65535
"""Depth value that means no measurement, as the page of the data set says."""
DEPTH_FOCAL_PX = 585.0
"""Focal length of the depth camera, as the page of the data set recommends."""
COLOR_FOCAL_PX = 525.0
"""Focal length that OpenNI assumes for the colour camera of an uncalibrated Kinect."""
KINECT_WIDTH_PX = 640
"""Image width for which these focal lengths hold."""
COLOR_FROM_DEPTH = np.array([[1, 0, 0, -0.025], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
"""[4,4] m: the colour camera of a Kinect is 2.5 cm to the right of its depth camera."""

Side = Annotated[int, Field(ge=1, le=MAX_SIDE_PX)]
Matrix = Annotated[
    list[FiniteFloat], Field(min_length=16, max_length=16), BeforeValidator(str.split)
]


class _Info(BaseModel):
    """Facts about a scan of BundleFusion; sizes and intrinsics in px."""

    model_config = ConfigDict(
        extra="ignore", frozen=True, alias_generator=lambda name: f"m_{to_camel(name)}"
    )

    color_width: Side
    color_height: Side
    depth_width: Side
    depth_height: Side
    depth_shift: Annotated[FiniteFloat, Field(gt=0)]
    calibration_color_intrinsic: Matrix
    calibration_depth_intrinsic: Matrix


def is_seven_scenes(path: Path) -> bool:
    """Return True if a folder is a sequence of 7-Scenes.

    Args:
        path: Any path.
    """
    return any(path.glob("frame-*.pose.txt")) or any(path.glob("frame-*.color.*"))


def open_seven_scenes(path: Path) -> Dataset:
    """Open a sequence.

    Args:
        path: Its folder; a file `camera-intrinsics.txt` (3 x 3) there replaces the intrinsics of
            the depth camera, and `info.txt` those of both cameras.

    Raises:
        OSError: The intrinsics cannot be read.
        ValueError: The intrinsics are damaged.
    """
    intrinsics = path / "camera-intrinsics.txt"
    matrix = read_numbers(intrinsics, (3, 3)) if intrinsics.exists() else None
    info = _read_info(path / "info.txt") if (path / "info.txt").exists() else None
    poses = sorted(path.glob("frame-*.pose.txt"))
    # Listed once: a sequence has 1,000 frames and more.
    images = {_stem(file): file for file in sorted(path.glob("frame-*.color.*"), reverse=True)}
    stems = [_stem(file) for file in poses] or sorted(images)

    def make(entry: tuple[int, str]) -> ImageFrame:
        number, stem = entry
        rgb = images.get(stem)
        if rgb is None:
            raise MissingImageError(f"{stem}.color.*", "image")
        size = image_size(rgb)
        depth = path / f"{stem}.depth.png"
        pose = rigid(read_numbers(path / f"{stem}.pose.txt", (4, 4))) if poses else np.eye(4)
        near: Camera | None
        if info is None:
            color = _color_camera(size, pose @ np.linalg.inv(COLOR_FROM_DEPTH))
            near = _depth_camera(size, pose, matrix)
        else:
            depth_size = image_size(depth) if depth.exists() else size
            color, near = _info_cameras(info, size, depth_size, pose)
        return ImageFrame(
            rgb,
            color,
            depth if depth.exists() else None,
            0.001 if info is None else 1 / info.depth_shift,
            depth_invalid=NO_DEPTH,
            time_s=float(number),
            depth_camera=near,
        )

    frames, skipped, missing = gather(zip(stems, enumerate(stems), strict=True), make)
    posed, unposed = (frames, ()) if poses else ((), frames)
    return Dataset(name_of(path), posed, skipped, unposed=unposed, missing=missing)


def _stem(file: Path) -> str:
    return file.name.split(".")[0]


def _color_camera(size: tuple[int, int], pose: Floats) -> Camera:
    width, height = size
    focal_px = COLOR_FOCAL_PX * width / KINECT_WIDTH_PX
    return pinhole((focal_px, focal_px, width / 2, height / 2), size, pose)


def _depth_camera(size: tuple[int, int], pose: Floats, matrix: Floats | None) -> Camera:
    width, height = size
    if matrix is None:
        focal_px = DEPTH_FOCAL_PX * width / KINECT_WIDTH_PX
        return pinhole((focal_px, focal_px, width / 2, height / 2), size, pose)
    return pinhole((matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2]), size, pose)


def _read_info(path: Path) -> _Info:
    """Read lines of the form `key = value`."""
    lines = read_bounded(path, MAX_MATRIX_BYTES).decode(errors="replace").splitlines()
    pairs = (line.partition("=") for line in lines)
    try:
        return _Info.model_validate({key.strip(): value.strip() for key, _, value in pairs})
    except ValidationError as error:
        raise ValueError(f"{path}: {first_problem(error)}") from None


def _info_cameras(
    info: _Info, size: tuple[int, int], depth_size: tuple[int, int], pose: Floats
) -> tuple[Camera, Camera | None]:
    """Return the cameras of colour and depth of these sizes; None if depth is registered."""
    color, depth = (
        resize_camera(scannet_camera(np.reshape(matrix, (4, 4)), calibrated, pose), px)
        for matrix, calibrated, px in (
            (info.calibration_color_intrinsic, (info.color_width, info.color_height), size),
            (info.calibration_depth_intrinsic, (info.depth_width, info.depth_height), depth_size),
        )
    )
    numbers = [(c.fx, c.fy, c.cx, c.cy, c.width, c.height) for c in (color, depth)]
    return color, None if numbers[0] == numbers[1] else depth
