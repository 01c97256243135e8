"""An image of a frame beside the map from the same pose."""

from __future__ import annotations

import numpy as np

from gslts.core.camera import at_pose
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.io.images import RgbImage, to_rgb8
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.types import Floats


def side_by_side(
    gaussian_map: GaussianMap, frame: RgbdFrame, world_from_camera: Floats, threads: int = 0
) -> RgbImage:
    """Render the map at the pose of a frame, and put it to the right of the frame.

    Args:
        gaussian_map: float32 or float64.
        frame: Its own pose is not used.
        world_from_camera: [4,4] pose of the frame in the map, m.
        threads: Number of threads; 0 means one per hardware thread.

    Returns:
        [H,2W,3] uint8 sRGB.
    """
    rasterizer, camera = Rasterizer(gaussian_map.dtype), at_pose(frame.camera, world_from_camera)
    images = rasterizer.forward(gaussian_map, camera, RenderOptions(threads=threads))
    return np.hstack([frame.rgb, to_rgb8(images.rgb)])
