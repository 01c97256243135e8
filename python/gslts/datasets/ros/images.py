"""Images and cameras from ROS messages."""

from __future__ import annotations

import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gslts.datasets.undistort import Lens, lens_or_none
from gslts.io.image_files import MAX_PIXELS, decode_integers, decode_rgb
from gslts.types import Floats32

Bytes = NDArray[np.uint8]

DEPTH_ENCODINGS = ("16UC1", "mono16", "32FC1")
"""Encodings of depth images (REP 118)."""
MILLIMETRE = 0.001
"""Unit of integer depth (REP 118), m."""

_COLOUR_CHANNELS = {
    "rgb8": (3, [0, 1, 2]),
    "bgr8": (3, [2, 1, 0]),
    "rgba8": (4, [0, 1, 2]),
    "bgra8": (4, [2, 1, 0]),
    "mono8": (1, [0, 0, 0]),
}
"""Bytes per pixel, and the indices of red, green and blue among them."""
_COEFFICIENTS = {"plumb_bob": (4, 5), "rational_polynomial": (8,), "equidistant": (4,)}
"""Numbers of coefficients of each supported distortion model of CameraInfo."""
_COMPRESSED_DEPTH_HEADER = struct.Struct("<iff")
"""Format, and quantisation parameters a and b, of compressed_depth_image_transport."""


def encoding_of(message: Any) -> str:
    """Return the encoding of an image message, such as "16UC1" or "jpeg".

    Args:
        message: An Image or CompressedImage.
    """
    if hasattr(message, "encoding"):
        return str(message.encoding)
    return str(message.format).split(";", maxsplit=1)[0].strip()


def rgb_of(message: Any) -> Bytes:
    """Decode a colour or grey image.

    Args:
        message: An Image or CompressedImage.

    Returns:
        [H,W,3] uint8 sRGB.

    Raises:
        ValueError: The message is damaged, or its encoding is not supported.
    """
    if hasattr(message, "encoding"):
        if message.encoding not in _COLOUR_CHANNELS:
            raise ValueError(f"the encoding {message.encoding} is not supported")
        channels, order = _COLOUR_CHANNELS[message.encoding]
        pixels = _rows(message, np.dtype(np.uint8), channels)
        return np.ascontiguousarray(pixels[..., order])
    return decode_rgb(bytes(message.data))


def depth_of(message: Any) -> Floats32:
    """Decode a depth image.

    Args:
        message: An Image, or a CompressedImage with a PNG.

    Returns:
        [H,W] float32 depth, m; 0 means no measurement.

    Raises:
        ValueError: The message is damaged, or its encoding is not supported.
    """
    encoding = encoding_of(message)
    if not hasattr(message, "encoding") and "compressedDepth" in message.format:
        return _compressed_depth(message, encoding)
    steps = steps_of(message)
    depth = steps.astype(np.float32) * np.float32(1 if encoding == "32FC1" else MILLIMETRE)
    return np.where(np.isfinite(depth) & (depth > 0), depth, np.float32(0))


def steps_of(message: Any) -> NDArray[Any]:
    """Decode an image of 16-bit integers or floats, such as of depth or of instances.

    Args:
        message: An Image, or a CompressedImage with a PNG.

    Returns:
        [H,W] as stored.

    Raises:
        ValueError: The message is damaged, or its encoding is not supported.
    """
    if not hasattr(message, "encoding"):
        return decode_integers(bytes(message.data))
    encoding = encoding_of(message)
    if encoding not in DEPTH_ENCODINGS:
        raise ValueError(f"the encoding {encoding} is not one of depth")
    order = ">" if message.is_bigendian else "<"
    kind = np.dtype(f"{order}f4" if encoding == "32FC1" else f"{order}u2")
    return np.asarray(_rows(message, kind, 1)[..., 0])


def _compressed_depth(message: Any, encoding: str) -> Floats32:
    """Decode a message of compressed_depth_image_transport: a 12-byte header and a PNG."""
    if "rvl" in message.format.lower():
        raise ValueError(
            f"the format {message.format!r} is not supported: record raw depth, or set the "
            "parameter `format` of compressedDepth to png"
        )
    data = bytes(message.data)
    if len(data) < _COMPRESSED_DEPTH_HEADER.size:
        raise ValueError("the compressed depth is cut off")
    _, a, b = _COMPRESSED_DEPTH_HEADER.unpack_from(data)
    steps = decode_integers(data[_COMPRESSED_DEPTH_HEADER.size :]).astype(np.float32)
    if encoding != "32FC1":
        return steps * np.float32(MILLIMETRE)
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.float32(a) / (steps - np.float32(b))  # Inverse depth is quantised evenly.
    return np.where((steps > 0) & np.isfinite(depth) & (depth > 0), depth, np.float32(0))


def _rows(message: Any, kind: np.dtype[Any], channels: int) -> NDArray[Any]:
    """Return the pixels [H,W,C] of an Image, whose rows may be padded."""
    height, width, step = int(message.height), int(message.width), int(message.step)
    data = np.asarray(message.data, np.uint8)
    if not 0 < height * width <= MAX_PIXELS:
        raise ValueError(f"an image cannot have {width} x {height} px")
    used = width * channels * kind.itemsize
    if step < used or len(data) < height * step:
        raise ValueError(
            f"{len(data)} bytes in rows of {step} are too few for {width} x {height} px "
            f"{message.encoding}"
        )
    rows = np.ascontiguousarray(data[: height * step].reshape(height, step)[:, :used])
    return rows.view(kind).reshape(height, width, channels)


def camera_of(info: Any, rectified: bool) -> tuple[tuple[float, ...], tuple[int, int], Lens | None]:
    """Read intrinsics, image size and lens from a CameraInfo.

    Args:
        info: The message.
        rectified: True if the images are rectified: then P is used instead of K and D.

    Returns:
        (fx, fy, cx, cy) px, (width, height) px, and the lens.

    Raises:
        ValueError: The distortion model, binning or a region of interest is not supported.
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
    # Pixel centres: whole numbers in ROS, +0.5 in this project.
    return (fx, fy, cx + 0.5, cy + 0.5), (int(info.width), int(info.height)), lens


def _lens(model: str, coefficients: list[float]) -> Lens | None:
    if not any(coefficients) and model != "equidistant":
        return None
    if model not in _COEFFICIENTS:
        raise ValueError(f"the distortion model {model[:40]!r} is not supported")
    maximum = max(_COEFFICIENTS[model])
    if any(coefficients[maximum:]):
        raise ValueError(f"the distortion model {model} has more than {maximum} coefficients")
    coefficients = coefficients[:maximum]
    if len(coefficients) not in _COEFFICIENTS[model]:
        raise ValueError(f"the distortion model {model} has {len(coefficients)} coefficients")
    return lens_or_none(coefficients, fisheye=model == "equidistant")
