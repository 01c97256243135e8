"""Seeds in holes of the depth: too near, too shiny, or outside the depth camera's field of view."""

from __future__ import annotations

import numpy as np

from gslts.core.camera import Camera
from gslts.core.gaussian_map import FloatArray, GaussianMap
from gslts.core.se3 import transform
from gslts.mapping.seeding.depth_seeds import flat_gaussians
from gslts.rendering.rasterizer import Images
from gslts.types import Bools, Floats

HOLE_ALPHA = 0.4
"""Rendered alpha below which a pixel is a hole."""
STRIDE_PX = 4
"""Distance of seeds in the image, px."""
OPACITY = 0.5
"""Opacity of seeds in holes: their depth is a guess, so they must be easy to remove."""
SMOOTHINGS = 4
"""Smoothing steps at each resolution, so that no steps of the coarser one remain."""


def seed_holes(
    camera: Camera,
    images: Images,
    colors: FloatArray,
    measured: FloatArray,
    mask: Bools | None,
    sh_degree: int,
) -> GaussianMap | None:
    """Seed Gaussians in holes at a depth interpolated from around the hole.

    Args:
        camera: Camera of the images, in the frame of the map's origin.
        images: Rendering of the map.
        colors: [H,W,3] colours of the photograph with the exposure of the map.
        measured: [H,W] measured depth, m; 0 is no measurement.
        mask: [H,W] pixels that count; None means all. There are no holes elsewhere.
        sh_degree: SH degree of the map.

    Returns:
        Flat Gaussians that face the camera; None if the rendering has no holes.
    """
    covered = images.alpha if mask is None else np.where(mask, images.alpha, 1)
    alpha, rendered = _bin_means(covered), _bin_means(images.depth)
    known = np.where((alpha >= HOLE_ALPHA) & (rendered > 0), rendered, 0)
    nearest = _bin_means(measured)
    known = np.where((known == 0) & (nearest > 0), nearest, known)
    holes = alpha < HOLE_ALPHA
    if not holes.any() or not known.any():
        return None
    depth = fill_zeros(known)[holes]
    rows, columns = np.nonzero(holes)
    u, v = ((index + 0.5) * STRIDE_PX for index in (columns, rows))
    x, y = (u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy
    pose = camera.world_from_camera
    points = transform(pose, np.stack([x * depth, y * depth, depth], axis=1))
    towards = pose[:3, 3] - points
    shades = np.stack([_bin_means(colors[..., c])[holes] for c in range(3)], axis=1)
    return flat_gaussians(
        points, towards, shades, depth * STRIDE_PX / camera.fx, OPACITY, sh_degree
    )


def fill_zeros(known: Floats) -> Floats:
    """Fill zeros of an image from ever coarser means of the rest (push-pull).

    Args:
        known: [H,W], 0 where unknown.

    Returns:
        [H,W] without zeros, unless all are zero.
    """
    if known.all() or min(known.shape) < 2:
        return np.where(known > 0, known, known[known > 0].mean() if known.any() else 0)
    height, width = known.shape
    padded = np.pad(known, ((0, height % 2), (0, width % 2)))
    four = padded.reshape(padded.shape[0] // 2, 2, padded.shape[1] // 2, 2)
    count = (four > 0).sum(axis=(1, 3))
    coarse = fill_zeros(four.sum(axis=(1, 3)) / np.maximum(count, 1))
    filled = coarse.repeat(2, axis=0).repeat(2, axis=1)[:height, :width]
    for _ in range(SMOOTHINGS):
        around = np.pad(np.where(known > 0, known, filled), 1, mode="edge")
        filled = (around[:-2, 1:-1] + around[2:, 1:-1] + around[1:-1, :-2] + around[1:-1, 2:]) / 4
    return np.where(known > 0, known, filled)


def _bin_means(image: FloatArray) -> Floats:
    """Return means of STRIDE_PX x STRIDE_PX pixels; incomplete blocks are cut off."""
    height, width = (length // STRIDE_PX for length in image.shape)
    part = image[: height * STRIDE_PX, : width * STRIDE_PX].astype(np.float64)
    means: Floats = part.reshape(height, STRIDE_PX, width, STRIDE_PX).mean(axis=(1, 3))
    return means
