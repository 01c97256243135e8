"""Images as messages."""

from __future__ import annotations

import array

import numpy as np
from sensor_msgs.msg import Image
from std_msgs.msg import Header

from gslts.types import Bytes


def image_message(header: Header, rgb: Bytes) -> Image:
    """Return a colour image.

    Args:
        header: Stamp and frame of the camera.
        rgb: [H,W,3] uint8, sRGB.
    """
    height, width, channels = rgb.shape
    # An array of bytes is copied whole; any other sequence, value by value.
    data = array.array("B")
    data.frombytes(np.ascontiguousarray(rgb).data)
    return Image(
        header=header,
        height=height,
        width=width,
        encoding="rgb8",
        is_bigendian=0,
        step=channels * width,
        data=data,
    )
