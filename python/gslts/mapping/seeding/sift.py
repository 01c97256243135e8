"""Points of pictures that can be found again in other pictures."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gslts.core.frame import RgbdFrame

MOST_FEATURES = 2000
"""Of a picture; the strongest."""
CONTRAST = 0.02
"""Least contrast of a feature; half of what OpenCV asks for, as rooms have faint textures."""
LONGEST_SIDE_PX = 1024
"""Larger pictures are halved until they fit: their noise goes, and so does half the time."""
FROM_MASK_PX = 6
"""So near to what the camera did not see a feature would be one of the border."""


@dataclass(frozen=True, eq=False)
class Features:
    """What was found in a picture.

    Attributes:
        places: [F,2] float64, px, pixel centres at +0.5.
        descriptors: [F,128] float32 integers, so that their products are exact in any order.
        colors: [F,3] uint8, sRGB.
    """

    places: NDArray[np.float64]
    descriptors: NDArray[np.float32]
    colors: NDArray[np.uint8]


def features(frame: RgbdFrame) -> Features:
    """SIFT features of a frame's colours, where its mask allows them; maybe none."""
    import cv2

    gray = cv2.cvtColor(frame.rgb, cv2.COLOR_RGB2GRAY)
    mask = None if frame.mask is None else frame.mask.astype(np.uint8)
    divisor = 1
    while max(gray.shape) > LONGEST_SIDE_PX:
        height, width = (length // 2 for length in gray.shape)
        even = gray[: 2 * height, : 2 * width]
        gray = cv2.resize(even, (width, height), interpolation=cv2.INTER_AREA)
        mask = None if mask is None else mask[: 2 * height : 2, : 2 * width : 2]
        divisor *= 2
    if mask is not None:
        mask = np.asarray(cv2.erode(mask, np.ones((2 * FROM_MASK_PX + 1,) * 2)), np.uint8)
    # Without precise upscaling all places are off by a quarter of a pixel.
    sift = cv2.SIFT.create(
        nfeatures=MOST_FEATURES, contrastThreshold=CONTRAST, enable_precise_upscale=True
    )
    keypoints, descriptors = sift.detectAndCompute(gray, mask)
    if not keypoints:
        nothing = np.zeros((0, 128), np.float32)
        return Features(np.zeros((0, 2)), nothing, np.zeros((0, 3), np.uint8))
    # OpenCV counts from the centre of the first pixel.
    places = (np.array([keypoint.pt for keypoint in keypoints], np.float64) + 0.5) * divisor
    columns, rows = np.floor(places).astype(np.intp).T
    height, width = frame.rgb.shape[:2]
    colors = frame.rgb[rows.clip(0, height - 1), columns.clip(0, width - 1)]
    return Features(places, np.asarray(descriptors, np.float32), colors)
