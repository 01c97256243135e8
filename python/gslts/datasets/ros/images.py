"""Pictures and cameras of ROS messages."""

from __future__ import annotations

import io
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gslts.datasets.dataset import MAX_PIXELS, reason_of
from gslts.datasets.undistort import Lens, lens_or_none
from gslts.types import Floats32

Bytes = NDArray[np.uint8]

DEPTH_ENCODINGS = ("16UC1", "mono16", "32FC1")
MILLIMETRE = 0.001
"""Unit of depth of whole numbers (REP 118), m."""

_COLOUR_CHANNELS = {
    "rgb8": (3, [0, 1, 2]),
    "bgr8": (3, [2, 1, 0]),
    "rgba8": (4, [0, 1, 2]),
    "bgra8": (4, [2, 1, 0]),
    "mono8": (1, [0, 0, 0]),
}
"""Bytes a pixel, and where red, green and blue are in them."""
_COEFFICIENTS = {"plumb_bob": (4, 5), "rational_polynomial": (8,), "equidistant": (4,)}
_COMPRESSED_DEPTH_HEADER = struct.Struct("<iff")


def encoding_of(message: Any) -> str:
    """How an Image or CompressedImage encodes its pixels: "16UC1" or the like, or "jpeg"."""
    if hasattr(message, "encoding"):
        return str(message.encoding)
    return str(message.format).split(";", maxsplit=1)[0].strip()


def rgb_of(message: Any) -> Bytes:
    """[H,W,3] uint8 of an Image or CompressedImage.

    Raises:
        ValueError: It is damaged, or of another encoding.
    """
    if hasattr(message, "encoding"):
        if message.encoding not in _COLOUR_CHANNELS:
            raise ValueError(f"the encoding {message.encoding} is not supported")
        channels, order = _COLOUR_CHANNELS[message.encoding]
        pixels = _rows(message, np.dtype(np.uint8), channels)
        return np.ascontiguousarray(pixels[..., order])
    return _decoded(message.data, "RGB").astype(np.uint8)


def depth_of(message: Any) -> Floats32:
    """[H,W] float32 m of an Image, or of a CompressedImage with PNG; 0 means no measurement.

    Raises:
        ValueError: It is damaged, or of another encoding.
    """
    encoding = encoding_of(message)
    if hasattr(message, "encoding"):
        if encoding not in DEPTH_ENCODINGS:
            raise ValueError(f"the encoding {encoding} is no depth")
        order = ">" if message.is_bigendian else "<"
        kind = np.dtype(f"{order}f4" if encoding == "32FC1" else f"{order}u2")
        steps = _rows(message, kind, 1)[..., 0]
    elif "compressedDepth" in message.format:
        return _compressed_depth(message, encoding)
    else:
        steps = _decoded(message.data, "I")
    depth = steps.astype(np.float32) * np.float32(1 if encoding == "32FC1" else MILLIMETRE)
    return np.where(np.isfinite(depth) & (depth > 0), depth, np.float32(0))


def _compressed_depth(message: Any, encoding: str) -> Floats32:
    """Of ROS's compressed_depth_image_transport: a header of 12 bytes, and a PNG."""
    if "rvl" in message.format.lower():
        raise ValueError(f"the format {message.format!r} is not supported")
    data = bytes(message.data)
    if len(data) < _COMPRESSED_DEPTH_HEADER.size:
        raise ValueError("the compressed depth is cut off")
    _, a, b = _COMPRESSED_DEPTH_HEADER.unpack_from(data)
    steps = _decoded(data[_COMPRESSED_DEPTH_HEADER.size :], "I").astype(np.float32)
    if encoding != "32FC1":
        return steps * np.float32(MILLIMETRE)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.float32(a) / (steps - np.float32(b))  # It is the inverse that has equal steps.
    return np.where((steps > 0) & np.isfinite(depth) & (depth > 0), depth, np.float32(0))


def _rows(message: Any, kind: np.dtype[Any], channels: int) -> NDArray[Any]:
    """[H,W,C] pixels of an Image, whose rows may be longer than what they hold."""
    height, width, step = int(message.height), int(message.width), int(message.step)
    data = np.asarray(message.data, np.uint8)
    if not 0 < height * width <= MAX_PIXELS:
        raise ValueError(f"an image cannot have {width} x {height} px")
    used = width * channels * kind.itemsize
    if step < used or len(data) < height * step:
        raise ValueError(
            f"{len(data)} bytes in rows of {step} are no {width} x {height} px {message.encoding}"
        )
    rows = np.ascontiguousarray(data[: height * step].reshape(height, step)[:, :used])
    return rows.view(kind).reshape(height, width, channels)


def _decoded(data: Any, mode: str) -> NDArray[Any]:
    """The pixels of a picture's file, in a mode of Pillow.

    Raises:
        ValueError: It is damaged, too large or of another format.
    """
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(io.BytesIO(bytes(data)), formats=("JPEG", "PNG")) as image:
            if image.width * image.height > MAX_PIXELS:
                raise ValueError(f"{image.width} x {image.height} px are more than {MAX_PIXELS}")
            return np.asarray(image.convert(mode))
    except UnidentifiedImageError:
        raise ValueError("it is neither JPEG nor PNG") from None
    except Exception as error:  # Pillow raises errors of any kind for damage.
        raise ValueError(f"its picture cannot be read: {reason_of(error)}") from None


def camera_of(info: Any, rectified: bool) -> tuple[tuple[float, ...], tuple[int, int], Lens | None]:
    """Of a CameraInfo: (fx, fy, cx, cy) px, (width, height) px, and the lens.

    Args:
        info: The message.
        rectified: Whether the pictures are rectified already: then P counts and not K, D.

    Raises:
        ValueError: The lens is of a kind that is not supported, or only a part of it is shown.
    """
    if info.binning_x > 1 or info.binning_y > 1 or info.roi.x_offset or info.roi.y_offset:
        raise ValueError("binning and regions of interest are not supported")
    k, p = info.k.tolist(), info.p.tolist()
    lens = None
    values = (k[0], k[4], k[2], k[5])
    if rectified and p[0] > 0:
        values = (p[0], p[5], p[2], p[6])
    elif not rectified:
        lens = _lens(str(info.distortion_model), info.d.tolist())
    fx, fy, cx, cy = values
    # ROS counts from the middle of the first pixel, this project from its corner.
    return (fx, fy, cx + 0.5, cy + 0.5), (int(info.width), int(info.height)), lens


def _lens(model: str, coefficients: list[float]) -> Lens | None:
    if not any(coefficients) and model != "equidistant":
        return None
    if model not in _COEFFICIENTS:
        raise ValueError(f"the distortion model {model[:40]!r} is not supported")
    most = max(_COEFFICIENTS[model])
    if any(coefficients[most:]):
        raise ValueError(f"the distortion model {model} has more than {most} coefficients")
    coefficients = coefficients[:most]
    if len(coefficients) not in _COEFFICIENTS[model]:
        raise ValueError(f"the distortion model {model} has {len(coefficients)} coefficients")
    return lens_or_none(coefficients, fisheye=model == "equidistant")
