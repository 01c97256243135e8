"""Images as messages."""

from __future__ import annotations

import array
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sensor_msgs.msg import Image
from std_msgs.msg import Header


def image_message(header: Header, pixels: NDArray[Any], encoding: str = "rgb8") -> Image:
    """Return an image.

    Args:
        header: Stamp and frame of the camera.
        pixels: [H,W,3] uint8, sRGB, or what else the encoding says, little-endian.
        encoding: Of the pixels.
    """
    rows = np.ascontiguousarray(pixels)
    # An array of bytes is copied whole; any other sequence, value by value.
    data = array.array("B")
    data.frombytes(rows.view(np.uint8).data)
    return Image(
        header=header,
        height=rows.shape[0],
        width=rows.shape[1],
        encoding=encoding,
        is_bigendian=0,
        step=rows.strides[0],
        data=data,
    )
