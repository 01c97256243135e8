"""Images inside of a page: data URLs."""

from __future__ import annotations

import base64

from gslts.io.image_files import encode_jpeg, encode_png
from gslts.io.images import RgbImage

JPEG_QUALITY = 85
"""Quality of JPEG images on pages."""


def jpeg_of(image: RgbImage) -> str:
    """Encode an image as a data URL of JPEG.

    Args:
        image: [H,W,3].
    """
    return data_url("image/jpeg", encode_jpeg(image, JPEG_QUALITY))


def png_of(image: RgbImage) -> str:
    """Encode an image as a data URL of PNG, for small or plain images.

    Args:
        image: [H,W,3].
    """
    return data_url("image/png", encode_png(image))


def data_url(kind: str, content: bytes) -> str:
    """Return the data URL of a file.

    Args:
        kind: Media type, such as "image/jpeg".
        content: Of the file.
    """
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"
