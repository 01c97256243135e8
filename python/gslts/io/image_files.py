"""Image files: the size in their header, their pixels, and files of pixels."""

from __future__ import annotations

import re
from collections.abc import Callable
from io import BytesIO
from pathlib import Path
from typing import IO, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from gslts.io.atomic_files import write_atomic
from gslts.io.bounded_files import Readable, read_bounded
from gslts.types import Bytes

SIGNATURES = {
    "JPEG": (b"\xff\xd8",),
    "PNG": (b"\x89PNG\r\n\x1a\n",),
    "TIFF": (b"II*\0", b"MM\0*", b"II+\0"),
    "BMP": (b"BM",),
    "WEBP": (b"RIFF",),
    "PPM": (b"P4", b"P5", b"P6"),
}
"""First bytes of each format that is read; OpenCV reads more, with decoders that few people use."""
MAX_PIXELS = 1 << 26
"""Maximum pixels of an image, checked before memory is taken; no camera of a robot has more."""
MAX_FILE_BYTES = 8 * MAX_PIXELS
"""Maximum size of an image file: that of four channels of 16 bits without compression."""
WRITTEN_SUFFIXES = (".bmp", ".jpeg", ".jpg", ".png", ".ppm", ".tif", ".tiff", ".webp")
"""Endings of the names of images that are written."""
PPM_HEADER, MAX_PPM_HEADER_BYTES = re.compile(rb"P[56](?:(?:\s|#.*\n)+(\d{1,5})){3}\s"), 4096
"""Width, height and maximum value of a PPM image, with comments; and maximum size of all that."""

Pixels = TypeVar("Pixels", bound=NDArray[Any])


def image_size(path: Readable) -> tuple[int, int]:
    """Read width and height of an image file, px.

    Args:
        path: Image file.

    Raises:
        OSError: The file cannot be read.
        ValueError: The file is not an image.
    """
    try:
        with path.open("rb") as file:
            return _size(file)
    except OSError:
        raise
    except Exception as error:  # A damaged archive raises errors of any kind.
        raise ValueError(f"{path}: {error}") from None


def read_rgb(path: Path, size: tuple[int, int]) -> Bytes:
    """Read a colour or grey image file; see `decode_rgb`.

    Args:
        path: Image file.
        size: Expected height and width, px.

    Returns:
        [H,W,3] uint8.

    Raises:
        OSError: The file cannot be read.
        ValueError: The file is damaged, too large or of another size.
    """
    return _read(path, size, decode_rgb)


def read_integers(path: Path, size: tuple[int, int]) -> NDArray[np.integer[Any]]:
    """Read an image file of one integer per pixel; see `decode_integers`.

    Args:
        path: Image file.
        size: Expected height and width, px.

    Returns:
        [H,W] of the data type in the file.

    Raises:
        OSError: The file cannot be read.
        ValueError: The file is damaged, too large, of another size or with other pixels.
    """
    return _read(path, size, decode_integers)


def decode_rgb(content: bytes, size: tuple[int, int] | None = None) -> Bytes:
    """Decode a colour or grey image; transparency and EXIF's orientation are ignored.

    Args:
        content: Of a file in a format of `SIGNATURES`.
        size: Expected height and width, px; None accepts any.

    Returns:
        [H,W,3] uint8.

    Raises:
        ValueError: The image is damaged, too large or of another size.
    """
    import cv2

    header = PPM_HEADER.match(content, 0, MAX_PPM_HEADER_BYTES)
    if header is not None and int(header[1]) not in (255, 65535):  # OpenCV does not scale them.
        raise ValueError(f"white is {int(header[1])}, expected 255 or 65535: convert it to PNG")
    return _decode(content, size, cv2.IMREAD_COLOR_RGB | cv2.IMREAD_IGNORE_ORIENTATION)


def decode_integers(
    content: bytes, size: tuple[int, int] | None = None
) -> NDArray[np.integer[Any]]:
    """Decode an image of one integer per pixel, such as depth in millimetres.

    Args:
        content: Of a file in a format of `SIGNATURES`.
        size: Expected height and width, px; None accepts any.

    Returns:
        [H,W] of the data type in the file.

    Raises:
        ValueError: The image is damaged, too large, of another size or with other pixels.
    """
    import cv2

    pixels = _decode(content, size, cv2.IMREAD_UNCHANGED)
    if pixels.ndim != 2 or not np.issubdtype(pixels.dtype, np.integer):
        channels = 1 if pixels.ndim == 2 else pixels.shape[2]
        raise ValueError(f"{channels} {pixels.dtype} per pixel, expected one integer")
    return pixels


def encode_png(image: NDArray[Any]) -> bytes:
    """Encode an image as PNG.

    A photograph of 640 x 480 px takes 14 ms and 462 kB with these options; with the strongest
    compression of zlib 290 ms and 449 kB.

    Args:
        image: [H,W,3] uint8 sRGB, or [H,W] uint8 or uint16.
    """
    import cv2

    strategy = [cv2.IMWRITE_PNG_STRATEGY, cv2.IMWRITE_PNG_STRATEGY_RLE]
    return _encode(".png", image, [*strategy, cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_PAETH])


def encode_jpeg(image: Bytes, quality: int) -> bytes:
    """Encode an image as JPEG.

    Args:
        image: [H,W,3] uint8 sRGB.
        quality: 0 to 100.
    """
    import cv2

    options = [cv2.IMWRITE_JPEG_QUALITY, quality, cv2.IMWRITE_JPEG_OPTIMIZE, 1]
    return _encode(".jpg", image, options)


def write_image(path: Path, image: Bytes) -> None:
    """Write an image atomically, in the format that the suffix of its name says.

    Args:
        path: File to write, such as view.png; its folder exists.
        image: [H,W,3] uint8, sRGB.

    Raises:
        OSError: The file cannot be written.
        ValueError: The suffix is that of no image format that can be written.
    """
    if path.suffix.lower() not in WRITTEN_SUFFIXES:
        raise ValueError(f"{path}: expected the name of an image, such as {path.stem}.png")
    content = encode_png(image) if path.suffix == ".png" else _encode(path.suffix, image, [])
    write_atomic(path, content)


def shrink_image(image: Bytes, max_px: tuple[int, int]) -> Bytes:
    """Shrink an image to a maximum size; each pixel is the mean of those that it covers.

    Args:
        image: [H,W,3] uint8.
        max_px: Maximum width and height, px.

    Returns:
        [h,w,3] uint8 with the aspect ratio of the image; the image itself if it is small enough.
    """
    import cv2

    height, width = image.shape[:2]
    scale = min(max_px[0] / width, max_px[1] / height)
    if scale >= 1:
        return image
    size = (max(1, round(scale * width)), max(1, round(scale * height)))
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)


def _size(file: IO[bytes]) -> tuple[int, int]:
    import imagesize

    start = file.read(max(len(each) for starts in SIGNATURES.values() for each in starts))
    is_known = any(start.startswith(starts) for starts in SIGNATURES.values())
    if start.startswith(SIGNATURES["PPM"]):  # Spaces between its numbers are read one by one.
        file = BytesIO(start + file.read(MAX_PPM_HEADER_BYTES))
    # Stored sizes: frames are used as the sensor made them.
    width, height = imagesize.get(file, exif_rotation=False) if is_known else (-1, -1)
    if min(width, height) <= 0:
        *others, last = SIGNATURES
        raise ValueError(f"not an image in {', '.join(others)} or {last}")
    return int(width), int(height)


def _read(path: Path, size: tuple[int, int], decode: Callable[..., Pixels]) -> Pixels:
    content = read_bounded(path, MAX_FILE_BYTES)
    try:
        return decode(content, size)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None


def _decode(content: bytes, expected: tuple[int, int] | None, flags: int) -> NDArray[Any]:
    import cv2

    width, height = _size(BytesIO(content))
    if expected is not None and (height, width) != expected:
        raise ValueError(f"{width} x {height} px, expected {expected[1]} x {expected[0]} px")
    if width * height > MAX_PIXELS:
        raise ValueError(f"{width} x {height} px, at most {MAX_PIXELS} pixels are read")
    try:
        pixels = cv2.imdecode(np.frombuffer(content, np.uint8), flags)
    except cv2.error:
        pixels = None
    if pixels is None or pixels.shape[:2] != (height, width):
        raise ValueError("the image is damaged, or of a kind that OpenCV does not read")
    return np.asarray(pixels)


def _encode(suffix: str, image: NDArray[Any], options: list[int]) -> bytes:
    import cv2

    pixels = image[..., ::-1] if image.ndim == 3 else image  # OpenCV writes BGR.
    return cv2.imencode(suffix, np.ascontiguousarray(pixels), options)[1].tobytes()
