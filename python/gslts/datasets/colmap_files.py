"""COLMAP's files of cameras, images and points, text or binary (its page "Output Format")."""

from __future__ import annotations

import mmap
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from gslts.datasets.dataset import PointCloud

MODELS = (
    ("SIMPLE_PINHOLE", 3),
    ("PINHOLE", 4),
    ("SIMPLE_RADIAL", 4),
    ("RADIAL", 5),
    ("OPENCV", 8),
    ("OPENCV_FISHEYE", 8),
    ("FULL_OPENCV", 12),
    ("FOV", 5),
    ("SIMPLE_RADIAL_FISHEYE", 4),
    ("RADIAL_FISHEYE", 5),
    ("THIN_PRISM_FISHEYE", 12),
    ("RAD_TAN_THIN_PRISM_FISHEYE", 16),
    ("SIMPLE_DIVISION", 4),
    ("DIVISION", 5),
    ("SIMPLE_FISHEYE", 3),
    ("FISHEYE", 4),
    ("EUCM", 6),
    ("EQUIRECTANGULAR", 2),
)
"""Name and number of parameters of each camera model; its index is its number in binary files."""
MAX_NAME_BYTES = 4096
"""Maximum length of the name of an image, that of a path in Linux."""
MAX_LINE_CHARACTERS = 1 << 27
"""Maximum length of a line: an image with 3 million keypoints."""
POINT_BYTES = 43
"""Bytes of a point in a binary file, without its track."""


@dataclass(frozen=True)
class ColmapCamera:
    """A camera of a model.

    Args:
        model: Name of the camera model.
        width: px.
        height: px.
        parameters: In the order of COLMAP's camera model.
    """

    model: str
    width: int
    height: int
    parameters: tuple[float, ...]


@dataclass(frozen=True)
class ColmapImage:
    """An image of a model.

    Args:
        name: Path of its file, relative to the folder of images.
        camera: Number of its camera.
        quaternion: (4,) wxyz of camera_from_world.
        translation: (3,) of camera_from_world.
    """

    name: str
    camera: int
    quaternion: tuple[float, ...]
    translation: tuple[float, ...]


def read_cameras(path: Path) -> dict[int, ColmapCamera]:
    """Read the cameras.

    Args:
        path: `cameras.txt` or `cameras.bin`.

    Returns:
        Cameras by their number.

    Raises:
        OSError: The file cannot be read.
        ValueError: The file is damaged.
    """
    if path.suffix == ".bin":
        with _Binary(path) as file:
            return dict(_binary_camera(file) for _ in range(file.count(24)))
    cameras = {}
    for number, line in _lines(path):
        words = line.split()
        if words and not words[0].startswith("#"):
            with _naming(path, number, line):
                width, height = int(words[2]), int(words[3])
                parameters = tuple(map(float, words[4:]))
                expected = dict(MODELS).get(words[1], len(parameters))
                if len(parameters) != expected:
                    raise ValueError(f"{words[1]} has {expected} parameters")
                cameras[int(words[0])] = ColmapCamera(words[1], width, height, parameters)
    return cameras


def read_images(path: Path) -> list[ColmapImage]:
    """Read the images that have a pose.

    Args:
        path: `images.txt` or `images.bin`.

    Raises:
        OSError: The file cannot be read.
        ValueError: The file is damaged.
    """
    if path.suffix == ".bin":
        with _Binary(path) as file:
            return [_binary_image(file) for _ in range(file.count(73))]
    images = []
    lines = _lines(path)
    for number, line in lines:
        words = line.split(maxsplit=9)
        if not words or words[0].startswith("#"):
            continue
        with _naming(path, number, line):
            values = tuple(map(float, words[1:8]))
            images.append(ColmapImage(words[9].strip(), int(words[8]), values[:4], values[4:]))
        next(lines, None)  # The keypoints; the line may be empty.
    return images


def read_points(path: Path) -> PointCloud:
    """Read the points of the scene.

    Args:
        path: `points3D.txt` or `points3D.bin`.

    Raises:
        OSError: The file cannot be read.
        ValueError: The file is damaged.
    """
    rows: list[tuple[Any, ...]] = []
    if path.suffix == ".bin":
        with _Binary(path) as file:
            for _ in range(file.count(POINT_BYTES + 8)):
                _, *row, _, track = file.take("<QdddBBBdQ")
                file.skip(track, 8)
                rows.append(tuple(row))
    else:
        for number, line in _lines(path):
            words = line.split(maxsplit=7)
            if words and not words[0].startswith("#"):
                with _naming(path, number, line):
                    rows.append(tuple(float(words[k]) for k in range(1, 7)))
    table = np.array(rows, np.float64).reshape(-1, 6)
    colors = table[:, 3:]
    if not np.isfinite(table).all() or ((colors < 0) | (colors > 255)).any():
        raise ValueError(f"{path}: a point is not finite or its colour not within 0 to 255")
    return PointCloud(table[:, :3].copy(), colors.astype(np.uint8))


def _binary_camera(file: _Binary) -> tuple[int, ColmapCamera]:
    key, model, width, height = file.take("<iiQQ")
    if not 0 <= model < len(MODELS):
        raise ValueError(f"{file.path}: camera {key} has the unknown model {model}")
    name, count = MODELS[model]
    return key, ColmapCamera(name, width, height, file.take(f"<{count}d"))


def _binary_image(file: _Binary) -> ColmapImage:
    _, *pose, camera = file.take("<i7di")
    name = file.text()
    (points,) = file.take("<Q")
    file.skip(points, 24)
    return ColmapImage(name, camera, tuple(pose[:4]), tuple(pose[4:]))


class _Binary:
    """Reads a binary file from its start, and checks that values lie within it."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._offset = 0

    def __enter__(self) -> _Binary:
        with self.path.open("rb") as file:
            if self.path.stat().st_size == 0:  # Which cannot be mapped.
                raise ValueError(f"{self.path}: it is empty")
            self._bytes = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        return self

    def __exit__(self, *_: object) -> None:
        self._bytes.close()

    def count(self, min_bytes: int) -> int:
        """Read the number of entries that follow, each of at least `min_bytes`."""
        (count,) = self.take("<Q")
        self._require(count * min_bytes)
        return int(count)

    def take(self, layout: str) -> tuple[Any, ...]:
        """Read the next values, in a layout of `struct`."""
        size = struct.calcsize(layout)
        self._require(size)
        self._offset += size
        return struct.unpack_from(layout, self._bytes, self._offset - size)

    def skip(self, count: int, size: int) -> None:
        """Skip `count` entries of `size` bytes."""
        self._require(count * size)
        self._offset += count * size

    def text(self) -> str:
        """Read a text that ends with a zero byte."""
        end = self._bytes.find(b"\0", self._offset, self._offset + MAX_NAME_BYTES)
        if end < 0:
            raise ValueError(f"{self.path}: a name at byte {self._offset} does not end")
        name = self._bytes[self._offset : end].decode("utf-8", errors="replace")
        self._offset = end + 1
        return name

    def _require(self, size: int) -> None:
        if size > len(self._bytes) - self._offset:
            raise ValueError(
                f"{self.path}: {size} bytes are missing at byte {self._offset} of "
                f"{len(self._bytes)}: the file is cut off or damaged"
            )


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    """Yield number and text of each line; the whole file is never in memory."""
    with path.open(encoding="utf-8", errors="replace") as file:
        number = 0
        while line := file.readline(MAX_LINE_CHARACTERS):
            number += 1
            if len(line) == MAX_LINE_CHARACTERS:
                raise ValueError(f"{path}: line {number} is too long")
            yield number, line


@contextmanager
def _naming(path: Path, number: int, line: str) -> Iterator[None]:
    """Add path, number and text of a line to its errors."""
    try:
        yield
    except (ValueError, IndexError, OverflowError) as error:
        raise ValueError(f"{path}: line {number}: {line.strip()[:80]!r}: {error}") from None
