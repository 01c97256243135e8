"""Recordings of Record3D, an app for phones with LiDAR: its `.r3d` files, and folders with EXR.

A `.r3d` file is a zip archive with `metadata`, and `rgbd/N.jpg`, `rgbd/N.depth` (float32, m) and
`rgbd/N.conf` (0 low, 1 medium, 2 high), both compressed with LZFSE; the unpacked folder will do.
The export "EXR + JPG" has `metadata.json`, `rgb/N.jpg` and `depth/N.exr`. Poses are camera to
world in the axes of OpenGL; the phone's first pose may be their origin: then the world is upright
only if the phone was.

Source: its developer in https://github.com/marek-simonik/record3d, issues 27, 36, 64 and 67, and
nerfstudio's `record3d_utils.py`.
"""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from gslts.core.camera import Camera
from gslts.datasets.arkit import pose_from_arkit
from gslts.datasets.dataset import Dataset, gather, name_of, pinhole, reason_of, resize_camera
from gslts.datasets.files import MissingImageError, read_json
from gslts.datasets.packed import PackedFrame
from gslts.datasets.poses import pose_from_quat
from gslts.io.bounded_files import read_bounded
from gslts.io.image_files import image_size
from gslts.types import Floats32

MAX_IMAGE_BYTES = 1 << 26
"""Maximum size of a JPEG; those of a phone take 1 MiB."""
MAX_SIDE_PX = 1920
"""Maximum side of a depth image; LiDAR has 192 x 256, and bounds what LZFSE may unpack to."""
RAW_BYTES_PER_BLOCK = 20_000
"""Minimum bytes that a full block of LZFSE unpacks to: 40,000 literals or 10,000 matches of 4 bytes
in Apple's encoder, halved. The library takes no maximum, but a block unpacks to 24 MB at most, so
that the number of blocks bounds the memory: to half a GB for 192 x 256 px."""

Row = tuple[FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat]
Pose = tuple[
    FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat
]
Side = Annotated[int, Field(ge=1, le=MAX_SIDE_PX)]


class _Metadata(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True)

    w: Annotated[int, Field(ge=1)]
    h: Annotated[int, Field(ge=1)]
    dw: Side = 192
    dh: Side = 256
    fps: Annotated[FiniteFloat, Field(gt=0)] = 30.0
    K: Annotated[list[FiniteFloat], Field(min_length=9, max_length=9)]
    poses: list[Pose]
    perFrameIntrinsicCoeffs: list[Row] = []  # noqa: N815
    frameTimestamps: list[FiniteFloat] = []  # noqa: N815


@dataclass(frozen=True)
class _Layout:
    """Names of the files of a recording; those of a frame are formatted with its number."""

    metadata: str
    rgb: str
    depth: str
    confidence: str = ""


R3D = _Layout("metadata", "rgbd/{}.jpg", "rgbd/{}.depth", "rgbd/{}.conf")
EXR = _Layout("metadata.json", "rgb/{}.jpg", "depth/{}.exr")
"""Layouts of recordings."""


def is_record3d(path: Path) -> bool:
    """Return True if a path is a `.r3d` file, or the folder of a recording.

    Args:
        path: Any path.
    """
    if path.is_file():
        return path.suffix.lower() == ".r3d"
    return any(
        (path / layout.metadata).is_file() and (path / layout.rgb).parent.is_dir()
        for layout in (R3D, EXR)
    )


def open_record3d(path: Path) -> Dataset:
    """Open a recording. Depth of low confidence is dropped.

    Args:
        path: A `.r3d` file, or a folder.

    Raises:
        ImportError: A package is missing.
        OSError: The recording cannot be read.
        ValueError: The recording is damaged.
    """
    root: Any = path
    if path.is_file():
        try:
            root = zipfile.Path(path)
        except OSError:
            raise
        except Exception as error:  # Of several kinds.
            raise ValueError(f"{path}: {reason_of(error)}") from None
    layout = R3D if (root / R3D.metadata).is_file() else EXR
    read_depth = _lzfse_reader() if layout is R3D else _exr_reader()
    if not (root / layout.metadata).is_file():
        raise ValueError(f"{path}: there is no {layout.metadata} in it")
    metadata = read_json(root / layout.metadata, _Metadata)

    def make(number: int) -> PackedFrame:
        rgb, depth = (root / name.format(number) for name in (layout.rgb, layout.depth))
        for file, kind in ((rgb, "image"), (depth, "depth image")):
            if not file.is_file():
                raise MissingImageError(file.name, kind)
        camera = _camera(metadata, number, image_size(rgb))
        depth_camera = resize_camera(camera, (metadata.dw, metadata.dh))
        confidence = root / layout.confidence.format(number) if layout.confidence else None
        times_s = metadata.frameTimestamps
        return PackedFrame(
            str(number),
            f"{path}: frame {number}",
            camera,
            partial(read_bounded, rgb, MAX_IMAGE_BYTES),
            partial(read_depth, depth, confidence, (metadata.dh, metadata.dw)),
            depth_camera,
            times_s[number] if number < len(times_s) else number / metadata.fps,
        )

    numbers = range(len(metadata.poses))
    frames, skipped, missing = gather(((str(number), number) for number in numbers), make)
    name = path.stem if path.is_file() else name_of(path)
    if len(set(metadata.poses)) > 1:
        return Dataset(name, frames, skipped, missing=missing)
    why = "all poses are the same: Record3D has none without LiDAR"
    return Dataset(name, (), skipped, unposed=frames, why_unposed=why, missing=missing)


def _camera(metadata: _Metadata, number: int, size: tuple[int, int]) -> Camera:
    """Return the camera of an image, which may be larger than the metadata say."""
    k, per_frame = metadata.K, metadata.perFrameIntrinsicCoeffs
    intrinsics = (k[0], k[4], k[6], k[7])  # The matrix is stored by columns.
    if number < len(per_frame):
        intrinsics = per_frame[number]
    x, y, z, w, *translation = metadata.poses[number]
    pose = pose_from_arkit(pose_from_quat((w, x, y, z), translation))
    return resize_camera(pinhole(intrinsics, (metadata.w, metadata.h), pose), size)


ReadDepth = Callable[[Any, Any, tuple[int, int]], Floats32]
"""Reads depth [H,W], m, from a file of depth and one of confidence or None, in a given size."""


def _lzfse_reader() -> ReadDepth:
    try:
        import lzfse
    except ImportError as error:
        raise ImportError(".r3d files need lzfse: pip install 'gslts[record3d]'") from error

    def unpack(file: Any, dtype: str, size: tuple[int, int]) -> Any:
        raw_bytes = size[0] * size[1] * np.dtype(dtype).itemsize
        packed = read_bounded(file, raw_bytes + RAW_BYTES_PER_BLOCK)
        if packed.count(b"bvx") > 2 + raw_bytes // RAW_BYTES_PER_BLOCK:
            raise ValueError(f"{file.name}: it would unpack to more than {raw_bytes} bytes")
        try:
            content = lzfse.decompress(packed)
        except (lzfse.error, MemoryError) as error:
            raise ValueError(f"{file.name}: not LZFSE, or damaged: {reason_of(error)}") from None
        if len(content) != raw_bytes:
            raise ValueError(f"{file.name}: {len(content)} bytes, expected {raw_bytes}")
        return np.frombuffer(content, dtype).reshape(size)

    def read(depth: Any, confidence: Any, size: tuple[int, int]) -> Floats32:
        metres = _valid(unpack(depth, "<f4", size))
        if confidence.is_file():
            metres[unpack(confidence, "u1", size) == 0] = 0
        return metres

    return read


def _exr_reader() -> ReadDepth:
    try:
        import OpenEXR
    except ImportError as error:
        raise ImportError("EXR depth needs OpenEXR: pip install 'gslts[record3d]'") from error

    def read(depth: Any, confidence: Any, size: tuple[int, int]) -> Floats32:
        del confidence  # These recordings have none.
        try:
            header = OpenEXR.File(str(depth), header_only=True).header()
            low, high = header["dataWindow"]
            found = (int(high[1] - low[1]) + 1, int(high[0] - low[0]) + 1)
            if found != size or len(header["channels"]) > 4:
                raise ValueError(f"{found} px, expected {size} px of one channel")
            channels = OpenEXR.File(str(depth), separate_channels=True).channels()
            channel = channels["R"] if "R" in channels else next(iter(channels.values()))
        except Exception as error:  # OpenEXR raises errors of any kind for damage.
            raise ValueError(f"{depth.name}: {reason_of(error)}") from None
        return _valid(channel.pixels)

    return read


def _valid(metres: Any) -> Floats32:
    """Return depth with 0 where it is not a positive number."""
    return np.where(np.isfinite(metres) & (metres > 0), metres, 0).astype(np.float32)
