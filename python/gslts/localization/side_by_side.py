"""A picture and the map from where it was taken, for people."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gslts.core.camera import at_pose
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.io.images import RgbImage, to_rgb8
from gslts.rendering.rasterizer import Rasterizer, RenderOptions


def side_by_side(
    gaussian_map: GaussianMap,
    frame: RgbdFrame,
    world_from_camera: NDArray[np.float64],
    threads: int = 0,
) -> RgbImage:
    """[H,2W,3] the photograph left, the map right.

    Args:
        gaussian_map: float32 or float64.
        frame: Its pose does not count.
        world_from_camera: [4,4] where it was taken.
        threads: 0 means one a hardware thread.
    """
    rasterizer, camera = Rasterizer(gaussian_map.dtype), at_pose(frame.camera, world_from_camera)
    images = rasterizer.forward(gaussian_map, camera, RenderOptions(threads=threads))
    return np.hstack([frame.rgb, to_rgb8(images.rgb)])
