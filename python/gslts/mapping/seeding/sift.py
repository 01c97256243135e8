"""SIFT keypoints of frames (Lowe 2004)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gslts.core.frame import RgbdFrame
from gslts.types import Bytes, Floats, Floats32

MAX_KEYPOINTS = 2000
"""Maximum number of keypoints of an image; the strongest are kept. The time of matching grows with
its square."""
MIN_CONTRAST = 0.02
"""Minimum contrast of a keypoint: half of OpenCV's default, as rooms have faint textures."""
MAX_SIDE_PX = 1024
"""Maximum width and height, px; larger images are halved, which averages noise and saves time."""
MASK_MARGIN_PX = 6
"""Margin inside a mask without keypoints, px: nearer ones describe the border of the mask."""


@dataclass(frozen=True, eq=False)
class Keypoints:
    """Keypoints of an image.

    Attributes:
        positions: [F,2] px, pixel centres at +0.5.
        descriptors: [F,128] integers, so that their products are exact in any order.
        colors: [F,3] sRGB.
    """

    positions: Floats
    descriptors: Floats32
    colors: Bytes


def detect_keypoints(frame: RgbdFrame) -> Keypoints:
    """Detect the SIFT keypoints of a frame inside its mask.

    Args:
        frame: Only colours and mask are used.

    Returns:
        The keypoints, possibly none.
    """
    import cv2

    gray = cv2.cvtColor(frame.rgb, cv2.COLOR_RGB2GRAY)
    mask = None if frame.mask is None else frame.mask.astype(np.uint8)
    divisor = 1
    while max(gray.shape) > MAX_SIDE_PX:
        height, width = (length // 2 for length in gray.shape)
        even = gray[: 2 * height, : 2 * width]
        gray = cv2.resize(even, (width, height), interpolation=cv2.INTER_AREA)
        mask = None if mask is None else mask[: 2 * height : 2, : 2 * width : 2]
        divisor *= 2
    if mask is not None:
        mask = np.asarray(cv2.erode(mask, np.ones((2 * MASK_MARGIN_PX + 1,) * 2)), np.uint8)
    # Without precise upscaling all positions are off by a quarter of a pixel.
    sift = cv2.SIFT.create(
        nfeatures=MAX_KEYPOINTS, contrastThreshold=MIN_CONTRAST, enable_precise_upscale=True
    )
    keypoints, descriptors = sift.detectAndCompute(gray, mask)
    if not keypoints:
        nothing = np.zeros((0, 128), np.float32)
        return Keypoints(np.zeros((0, 2)), nothing, np.zeros((0, 3), np.uint8))
    # OpenCV has the origin at the centre of the first pixel.
    positions = (np.array([keypoint.pt for keypoint in keypoints], np.float64) + 0.5) * divisor
    columns, rows = np.floor(positions).astype(np.intp).T
    height, width = frame.rgb.shape[:2]
    colors = frame.rgb[rows.clip(0, height - 1), columns.clip(0, width - 1)]
    return Keypoints(positions, np.asarray(descriptors, np.float32), colors)
