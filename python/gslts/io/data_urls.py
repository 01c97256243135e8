"""Images inside of a page: data URLs."""

from __future__ import annotations

import base64
import io
from typing import Any

from gslts.io.images import RgbImage

JPEG_QUALITY = 85
"""Quality of JPEG images on pages."""


def jpeg_of(image: RgbImage) -> str:
    """Encode an image as a data URL of JPEG.

    Args:
        image: [H,W,3].
    """
    return _encode(image, "JPEG", quality=JPEG_QUALITY, optimize=True)


def png_of(image: RgbImage) -> str:
    """Encode an image as a data URL of PNG, for small or plain images.

    Args:
        image: [H,W,3].
    """
    return _encode(image, "PNG", optimize=True)


def data_url(kind: str, content: bytes) -> str:
    """Return the data URL of a file.

    Args:
        kind: Media type, such as "image/jpeg".
        content: Of the file.
    """
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"


def _encode(image: RgbImage, kind: str, **options: Any) -> str:
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(image).save(buffer, format=kind, **options)
    return data_url(f"image/{kind.lower()}", buffer.getvalue())
