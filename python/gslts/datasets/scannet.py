"""Scans of ScanNet (Dai et al. 2017), exported by its SensReader: color, depth, pose, intrinsic.

Source: https://github.com/ScanNet/ScanNet, folder SensReader.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from gslts.core.camera import Camera
from gslts.datasets.dataset import Dataset, gather, name_of, pinhole, read_numbers, rigid
from gslts.datasets.files import image_file
from gslts.datasets.image_frame import ImageFrame
from gslts.io.image_files import image_size
from gslts.types import Floats

FOLDERS = ("color", "depth", "pose", "intrinsic")
"""Folders of a scan."""


def is_scannet(path: Path) -> bool:
    """Return True if a folder is an exported scan.

    Args:
        path: Any path.
    """
    return all((path / name).is_dir() for name in FOLDERS)


def open_scannet(path: Path) -> Dataset:
    """Open an exported scan.

    Both cameras have the pose of the frame, as ScanNet's own tools assume. Frames for which
    tracking was lost have an infinite pose, and are skipped.

    Args:
        path: Folder of the scan.

    Raises:
        OSError: The intrinsics cannot be read.
        ValueError: The intrinsics are damaged.
    """
    color, depth = (
        read_numbers(path / "intrinsic" / f"intrinsic_{name}.txt", (4, 4))
        for name in ("color", "depth")
    )
    stems = sorted((file.stem for file in (path / "pose").glob("*.txt")), key=_number)

    def make(stem: str) -> ImageFrame:
        rgb = image_file(path, f"color/{stem}.jpg")
        depth_path = image_file(path, f"depth/{stem}.png", "depth image")
        pose = rigid(read_numbers(path / "pose" / f"{stem}.txt", (4, 4)))
        return ImageFrame(
            rgb,
            scannet_camera(color, image_size(rgb), pose),
            depth_path,
            time_s=float(_number(stem)),
            depth_camera=scannet_camera(depth, image_size(depth_path), pose),
        )

    frames, skipped, missing = gather(((stem, stem) for stem in stems), make)
    return Dataset(name_of(path), frames, skipped, missing=missing)


def scannet_camera(matrix: Floats, size: tuple[int, int], pose: Floats) -> Camera:
    """Return a camera of ScanNet, whose pixel centres are whole numbers.

    Args:
        matrix: [4,4] intrinsics, px.
        size: Width and height of the image, px.
        pose: [4,4] world_from_camera, m.

    Raises:
        ValueError: The intrinsics do not fit the image.
    """
    fx, fy, cx, cy = np.array([matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2]]).tolist()
    return pinhole((fx, fy, cx + 0.5, cy + 0.5), size, pose)


def _number(stem: str) -> int:
    """Return the number of a frame; -1 if its name is none."""
    return int(stem) if stem.isdecimal() else -1
