"""COLMAP's files of cameras, images and points, as text or binary, by its page "Output Format"."""

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
"""Names and numbers of parameters of the camera models, by the number in binary files."""
NAME_BYTES = 4096
"""Longer names of images are no names."""
LINE_CHARACTERS = 1 << 27
POINT_BYTES = 43
"""Of a point in a binary file, without its track."""


@dataclass(frozen=True)
class ColmapCamera:
    """A camera: the name of its model, the size of its images in px, and its parameters."""

    model: str
    width: int
    height: int
    parameters: tuple[float, ...]


@dataclass(frozen=True)
class ColmapImage:
    """An image: the quaternion wxyz and the translation of camera_from_world."""

    name: str
    camera: int
    quaternion: tuple[float, ...]
    translation: tuple[float, ...]


def read_cameras(path: Path) -> dict[int, ColmapCamera]:
    """Cameras by their number, of `cameras.txt` or `cameras.bin`.

    Raises:
        OSError: The file cannot be read.
        ValueError: It is damaged.
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
    """Images that have a pose, of `images.txt` or `images.bin`.

    Raises:
        OSError: The file cannot be read.
        ValueError: It is damaged.
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
        next(lines, None)  # What was detected in it; the line may be empty.
    return images


def read_points(path: Path) -> PointCloud:
    """Points of `points3D.txt` or `points3D.bin`.

    Raises:
        OSError: The file cannot be read.
        ValueError: It is damaged.
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
    """A binary file, read from its start; nothing is taken that it does not hold."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._place = 0

    def __enter__(self) -> _Binary:
        with self.path.open("rb") as file:
            if self.path.stat().st_size == 0:  # Which cannot be mapped.
                raise ValueError(f"{self.path}: it is empty")
            self._bytes = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
        return self

    def __exit__(self, *_: object) -> None:
        self._bytes.close()

    def count(self, least_bytes: int) -> int:
        """The number of entries that follow, each of at least so many bytes."""
        (count,) = self.take("<Q")
        self._need(count * least_bytes)
        return int(count)

    def take(self, layout: str) -> tuple[Any, ...]:
        """The next values, in a layout of `struct`."""
        size = struct.calcsize(layout)
        self._need(size)
        self._place += size
        return struct.unpack_from(layout, self._bytes, self._place - size)

    def skip(self, count: int, size: int) -> None:
        """Leaves out entries of a size in bytes."""
        self._need(count * size)
        self._place += count * size

    def text(self) -> str:
        """The next text, up to a zero."""
        end = self._bytes.find(b"\0", self._place, self._place + NAME_BYTES)
        if end < 0:
            raise ValueError(f"{self.path}: a name at byte {self._place} does not end")
        found = self._bytes[self._place : end].decode("utf-8", errors="replace")
        self._place = end + 1
        return found

    def _need(self, size: int) -> None:
        if size > len(self._bytes) - self._place:
            raise ValueError(
                f"{self.path}: {size} bytes are missing at byte {self._place} of "
                f"{len(self._bytes)}: the file is cut off or damaged"
            )


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    """Numbers and text of lines; the whole file is never in memory."""
    with path.open(encoding="utf-8", errors="replace") as file:
        number = 0
        while line := file.readline(LINE_CHARACTERS):
            number += 1
            if len(line) == LINE_CHARACTERS:
                raise ValueError(f"{path}: line {number} is too long")
            yield number, line


@contextmanager
def _naming(path: Path, number: int, line: str) -> Iterator[None]:
    """Makes what goes wrong in a line say which one it is."""
    try:
        yield
    except (ValueError, IndexError, OverflowError) as error:
        raise ValueError(f"{path}: line {number}: {line.strip()[:80]!r}: {error}") from None
