"""Scans of ScanNet (Dai et al. 2017) as one `.sens` file.

Source: https://github.com/ScanNet/ScanNet, `SensReader/README.md` and `SensReader/python`. Numbers
are little-endian without padding.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import IO, Any

import numpy as np

from gslts.datasets.dataset import Dataset, gather, rigid
from gslts.datasets.packed import PackedFrame
from gslts.datasets.scannet import scannet_camera
from gslts.io.image_files import MAX_PIXELS
from gslts.types import Floats, Floats32

VERSION = 4
"""Version of the format, the only one of ScanNet."""
MAX_NAME_BYTES = 4096
"""Maximum length of the name of the sensor."""
JPEG_OR_PNG, RAW_DEPTH, ZLIB_DEPTH = (1, 2), 0, 1
"""Compression of colour and of depth that is supported; raw colour and "occi" depth are not."""
_SIZES = struct.Struct("<2i4IfQ")
"""Compression of colour and depth, width and height of both, steps per metre, number of frames."""
_FRAME = struct.Struct("<16f4Q")
"""Pose by rows, times of colour and depth in microseconds, bytes of colour and depth."""


@dataclass(frozen=True)
class _Header:
    """Header of a file: intrinsics [4,4] px, sizes (width, height), unit of depth."""

    color: Floats
    depth: Floats
    color_size: tuple[int, int]
    depth_size: tuple[int, int]
    is_depth_packed: bool
    steps_per_m: float
    count: int


@dataclass(frozen=True)
class _Entry:
    """Position of a frame in a file, in bytes."""

    number: int
    pose: Floats
    time_s: float
    start: int
    color_bytes: int
    depth_bytes: int


def is_sens(path: Path) -> bool:
    """Return True if a path is a `.sens` file.

    Args:
        path: Any path.
    """
    return path.suffix.lower() == ".sens" and path.is_file()


def open_sens(path: Path) -> Dataset:
    """Open a scan; see `open_scannet` for the poses.

    Args:
        path: A `.sens` file.

    Raises:
        OSError: The file cannot be read.
        ValueError: The file is damaged, cut off, or compressed in an unsupported format.
    """
    with path.open("rb") as file:
        header = _read_header(path, file)
        entries = list(_read_entries(path, file, header.count))

    def make(entry: _Entry) -> PackedFrame:
        pose = rigid(entry.pose)
        return PackedFrame(
            str(entry.number),
            f"{path}: frame {entry.number}",
            scannet_camera(header.color, header.color_size, pose),
            partial(_read, path, entry.start, entry.color_bytes),
            partial(_read_depth, path, entry, header),
            scannet_camera(header.depth, header.depth_size, pose),
            entry.time_s,
        )

    frames, skipped, missing = gather(((str(each.number), each) for each in entries), make)
    return Dataset(path.stem, frames, skipped, missing=missing)


def _read_header(path: Path, file: IO[bytes]) -> _Header:
    version, name_bytes = struct.unpack("<IQ", _take(path, file, 12))
    if version != VERSION:
        raise ValueError(f"{path}: version {version}, expected {VERSION}")
    if name_bytes > MAX_NAME_BYTES:
        raise ValueError(f"{path}: the name of the sensor has {name_bytes} bytes")
    _take(path, file, name_bytes)
    matrices = np.frombuffer(_take(path, file, 256), "<f4").reshape(4, 4, 4).astype(np.float64)
    color, depth, *sizes, steps_per_m, count = _SIZES.unpack(_take(path, file, _SIZES.size))
    if color not in JPEG_OR_PNG or depth not in (RAW_DEPTH, ZLIB_DEPTH):
        raise ValueError(f"{path}: compression {color} of colour, {depth} of depth: not supported")
    if sizes[2] * sizes[3] > MAX_PIXELS or not steps_per_m > 0:
        raise ValueError(
            f"{path}: depth of {sizes[2]} x {sizes[3]} px, {steps_per_m:g} steps per m"
        )
    return _Header(
        color=matrices[0],
        depth=matrices[2],  # Each is followed by extrinsics.
        color_size=(sizes[0], sizes[1]),
        depth_size=(sizes[2], sizes[3]),
        is_depth_packed=depth == ZLIB_DEPTH,
        steps_per_m=steps_per_m,
        count=count,
    )


def _read_entries(path: Path, file: IO[bytes], count: int) -> Iterator[_Entry]:
    """Yield the positions of all frames, which lie within the file."""
    end = os.fstat(file.fileno()).st_size
    for number in range(count):
        *pose, time_us, _, color_bytes, depth_bytes = _FRAME.unpack(_take(path, file, _FRAME.size))
        start = file.tell()
        if color_bytes + depth_bytes > end - start:
            raise ValueError(f"{path}: cut off in frame {number} of {count}")
        file.seek(color_bytes + depth_bytes, os.SEEK_CUR)
        matrix = np.array(pose).reshape(4, 4)
        yield _Entry(number, matrix, time_us * 1e-6, start, color_bytes, depth_bytes)


def _take(path: Path, file: IO[bytes], count: int) -> bytes:
    content = file.read(count)
    if len(content) < count:
        raise ValueError(f"{path}: cut off at byte {file.tell()}")
    return content


def _read(path: Path, start: int, count: int) -> bytes:
    with path.open("rb") as file:
        file.seek(start)
        return _take(path, file, count)


def _read_depth(path: Path, entry: _Entry, header: _Header) -> Floats32:
    """Return depth [H,W], m."""
    width, height = header.depth_size
    expected = 2 * width * height
    content: Any = _read(path, entry.start + entry.color_bytes, entry.depth_bytes)
    if header.is_depth_packed:
        try:
            content = zlib.decompressobj().decompress(content, expected)
        except zlib.error as error:
            raise ValueError(f"depth: {error}") from None
    if len(content) != expected:
        raise ValueError(f"depth: {len(content)} bytes, expected {expected}")
    steps = np.frombuffer(content, "<u2").reshape(height, width)
    return (steps / header.steps_per_m).astype(np.float32)
