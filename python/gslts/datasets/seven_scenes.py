"""7-Scenes (Shotton et al. 2013): frame-N.color, .depth.png and .pose.txt in one folder.

Without any .pose.txt, frames have no pose.

The images come from a Kinect without registration: the poses, found by KinectFusion, are those of
the depth camera.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gslts.core.camera import Camera
from gslts.datasets.dataset import Dataset, gather, name_of, pinhole, read_numbers, rigid
from gslts.datasets.files import MissingImageError
from gslts.datasets.image_frame import ImageFrame
from gslts.io.image_files import image_size
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
            the depth camera.

    Raises:
        OSError: The intrinsics cannot be read.
        ValueError: The intrinsics are damaged.
    """
    intrinsics = path / "camera-intrinsics.txt"
    matrix = read_numbers(intrinsics, (3, 3)) if intrinsics.exists() else None
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
        return ImageFrame(
            rgb,
            _color_camera(size, pose @ np.linalg.inv(COLOR_FROM_DEPTH)),
            depth if depth.exists() else None,
            depth_invalid=NO_DEPTH,
            time_s=float(number),
            depth_camera=_depth_camera(size, pose, matrix),
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
