"""Resolutions in which a frame is localized."""

import numpy as np
import pytest

from gslts.core.camera import camera_from_fov
from gslts.core.frame import RgbdFrame
from gslts.localization.image_pyramid import ImagePyramid


@pytest.mark.parametrize(("width", "finest"), [(640, 2), (320, 1), (160, 0), (1280, 2)])
def test_the_finest_image_is_wide_enough(width: int, finest: int) -> None:
    size = width, width * 3 // 4
    frame = RgbdFrame(
        rgb=np.zeros((*size[::-1], 3), np.uint8),
        depth=np.ones(size[::-1], np.float32),
        camera=camera_from_fov(*size, np.deg2rad(69), np.eye(4)),
        time_s=0.0,
    )
    pyramid = ImagePyramid.of(frame)
    assert list(pyramid.levels(2)) == list(range(len(pyramid.frames) - 1, finest - 1, -1))
