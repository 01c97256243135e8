"""Exports of RTAB-Map (Labbé and Michaud 2019): images, calibrations and optimized poses.

`rtabmap-export --images --poses_camera NAME.db` writes `NAME_rgb/STAMP.jpg`, `NAME_depth/STAMP.png`
(16-bit, mm), `NAME_calib/STAMP.yaml` and `NAME_camera_poses.txt`, and newer versions
`NAME_confidence/STAMP.png`. The poses have format 11, the default: stamp x y z qx qy qz qw id, in
the frames of ROS. With `--images_id`, images are named by the id. Databases are not read.

Source: https://github.com/introlab/rtabmap, `tools/Export/main.cpp`, and `exportPoses` and
`CameraModel` in `corelib/src`. As there, images are taken as rectified.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from gslts.core.camera import Camera
from gslts.datasets.dataset import (
    MAX_MATRIX_BYTES,
    Dataset,
    gather,
    name_of,
    pinhole,
    reason_of,
    resize_camera,
    rigid,
)
from gslts.datasets.files import MissingImageError, image_file, read_rows
from gslts.datasets.image_frame import ImageFrame
from gslts.datasets.poses import pose_from_numbers
from gslts.io.bounded_files import read_bounded
from gslts.io.image_files import image_size
from gslts.types import Floats

SIDES = ("width", "height")
SHAPES = {"projection_matrix": (3, 4), "camera_matrix": (3, 3), "local_transform": (3, 4)}
"""Entries of a calibration: sides of the image, and shapes of matrices."""
COLUMNS = 9
"""Values of a row of poses in format 11."""
HOW_TO_EXPORT = "rtabmap-export --images --poses_camera DATABASE.db"
"""Command that writes what is needed."""


def is_rtabmap(path: Path) -> bool:
    """Return True if a folder has images and calibrations of an export, or a file is a database.

    Args:
        path: Any path.
    """
    return bool(_prefixes(path)) if path.is_dir() else path.suffix == ".db"


def open_rtabmap(path: Path) -> Dataset:
    """Open an export. Depth of zero confidence is dropped.

    Poses of the robot (`--poses`) will do if the calibrations tell where the camera is.

    Args:
        path: Folder of the export.

    Raises:
        OSError: The poses cannot be read.
        ValueError: There are no poses, several exports, or the poses are of another format; or the
            path is a database.
    """
    if path.is_file():
        raise ValueError(f"{path}: databases are not read: export it with {HOW_TO_EXPORT}")
    prefix, *others = _prefixes(path)
    if others:
        raise ValueError(f"{path}: several exports, such as {prefix}rgb and {others[0]}rgb")
    poses = _poses_file(path, prefix)
    rows, bad_lines = read_rows(poses, COLUMNS, COLUMNS)
    if bad_lines:
        raise ValueError(
            f"{poses}: {bad_lines[0]}; other formats do not say which axes they have: export with "
            f"{HOW_TO_EXPORT}"
        )
    of_camera = "camera" in poses.name[len(prefix) :]
    entries = ((row[0], row) for row in rows)
    frames, skipped, missing = gather(entries, lambda row: _frame(path, prefix, row, of_camera))
    return Dataset(name_of(path), frames, skipped, missing=missing)


def _prefixes(path: Path) -> list[str]:
    """Return what precedes `rgb` and `calib` in the names of folders."""
    names = {each.name for each in path.iterdir() if each.is_dir()}
    starts = sorted(name.removesuffix("rgb") for name in names if name.endswith("rgb"))
    return [start for start in starts if f"{start}calib" in names]


def _poses_file(path: Path, prefix: str) -> Path:
    """Return the file with poses of the camera, or else of the robot."""
    files = sorted(path.glob("*.txt"))
    names = [file for file in files if file.name.startswith(prefix) and "scan" not in file.name]
    of_camera = [file for file in names if "camera" in file.name[len(prefix) :]]
    found = of_camera or [file for file in names if "poses" in file.name[len(prefix) :]]
    if len(found) == 1:
        return found[0]
    if found:
        raise ValueError(f"{path}: poses of several cameras, which are not supported: {found[0]}")
    raise ValueError(f"{path}: there are no poses: export with {HOW_TO_EXPORT}")


def _frame(path: Path, prefix: str, row: list[str], of_camera: bool) -> ImageFrame:
    stamp, node = row[0], row[-1]
    rgb = path / f"{prefix}rgb" / f"{stamp}.jpg"
    if not rgb.is_file():
        rgb = path / f"{prefix}rgb" / f"{node}.jpg"
    if not rgb.is_file():
        raise MissingImageError(f"{prefix}rgb/{stamp}.jpg", "image")
    calibration = _Calibration(path / f"{prefix}calib" / f"{rgb.stem}.yaml")
    pose = pose_from_numbers(np.array(row[1:8], np.float64))
    camera = calibration.camera(
        image_size(rgb), pose if of_camera else rigid(pose @ calibration.robot_from_camera())
    )
    depth = depth_camera = None
    if (path / f"{prefix}depth").is_dir():
        depth = image_file(path, f"{prefix}depth/{rgb.stem}.png", "depth image")
        size = image_size(depth)
        if size != (camera.width, camera.height):
            depth_camera = resize_camera(camera, size)
    confidence = path / f"{prefix}confidence" / f"{rgb.stem}.png"
    return ImageFrame(
        rgb,
        camera,
        depth,
        time_s=float(stamp),
        depth_camera=depth_camera,
        confidence=confidence if confidence.is_file() else None,
    )


class _Calibration:
    """A file that `CameraModel::save` wrote with OpenCV.

    Args:
        path: YAML file.

    Raises:
        OSError: The file cannot be read.
        ValueError: The file is damaged.
    """

    def __init__(self, path: Path) -> None:
        import cv2

        self._path = path
        text = read_bounded(path, MAX_MATRIX_BYTES).decode(errors="replace")
        try:
            mode = cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY
            file: Any = cv2.FileStorage(text, mode | cv2.FILE_STORAGE_FORMAT_YAML)
            self._size = tuple(int(file.getNode(f"image_{side}").real()) for side in SIDES)
            self._matrices = {name: _numbers(file.getNode(name)) for name in SHAPES}
        except Exception as error:  # OpenCV raises errors of several kinds for damage.
            raise ValueError(f"{path}: not a calibration: {reason_of(error)[-80:]}") from None

    def camera(self, size: tuple[int, int], pose: Floats) -> Camera:
        """Return the camera of rectified images; pixel centres are whole numbers in the file."""
        if self._size != size:
            raise ValueError(f"{self._path}: of images of {self._size} px, this one has {size} px")
        matrix = self._matrix("projection_matrix")
        if matrix is None:
            matrix = self._matrix("camera_matrix")
        if matrix is None:
            raise ValueError(f"{self._path}: there is no camera_matrix of 3 x 3 numbers")
        fx, fy, cx, cy = (float(matrix[at]) for at in ((0, 0), (1, 1), (0, 2), (1, 2)))
        return pinhole((fx, fy, cx + 0.5, cy + 0.5), size, pose)

    def robot_from_camera(self) -> Floats:
        """Return the pose [4,4] of the camera on the robot, m."""
        matrix = self._matrix("local_transform")
        if matrix is None:
            raise ValueError(
                f"{self._path}: it does not say where the camera is on the robot; export the poses "
                f"of the camera: {HOW_TO_EXPORT}"
            )
        return np.vstack([matrix, [0, 0, 0, 1]])

    def _matrix(self, name: str) -> Floats | None:
        """Return a matrix; None if there is none of the right shape."""
        numbers, (rows, columns) = self._matrices[name], SHAPES[name]
        return numbers.reshape(rows, columns) if len(numbers) == rows * columns else None


def _numbers(node: Any) -> Floats:
    """Return the numbers of a matrix in a file of OpenCV; none if it is no matrix."""
    data = node.getNode("data") if node.isMap() else node
    return np.array([data.at(k).real() for k in range(data.size())] if data.isSeq() else [])
