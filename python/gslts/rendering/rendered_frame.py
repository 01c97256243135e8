"""RGB-D frames that a map stands for: renderings with colours and depth."""

from __future__ import annotations

import numpy as np

from gslts.core.camera import Camera
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.io.images import to_rgb8
from gslts.rendering.rasterizer import Rasterizer, RenderOptions

MIN_ALPHA = 0.5
"""Minimum opacity of a pixel with a depth: below it, the rendering shows no surface."""


def render_frame(gaussian_map: GaussianMap, camera: Camera, threads: int = 0) -> RgbdFrame:
    """Render the frame that a camera would take if the map were the world.

    Args:
        gaussian_map: float32.
        camera: Of the frame.
        threads: 0 means one per hardware thread.
    """
    images = Rasterizer(np.float32).forward(gaussian_map, camera, RenderOptions(threads=threads))
    rgb = to_rgb8(images.rgb)
    depth = np.where(images.alpha >= MIN_ALPHA, images.depth, 0).astype(np.float32)
    return RgbdFrame(rgb, depth, camera)
