"""Semantic features of Gaussians in closed form, by back-projection with the blending weights.

The feature of a Gaussian minimizes sum_p w_p |f - S_p|^2 over the pixels p of all views, where w_p
is its blending weight at p and S_p the feature of the pixel: f = sum_p w_p S_p / sum_p w_p, the
transpose of rendering. GS-LTS reaches about the same features by gradient descent (`refine`).
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from gslts.core.camera import Camera
from gslts.core.gaussian_map import GaussianMap
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.types import Bools, Floats32

FeatureView = tuple[Camera, Floats32, Bools]
"""Camera, feature image [H,W,D], and mask [H,W] of the pixels that have a feature."""


def lift_features(
    gaussian_map: GaussianMap, views: Iterable[FeatureView], dims: int, threads: int = 0
) -> Floats32:
    """Compute the features of all Gaussians from feature images.

    Args:
        gaussian_map: float32.
        views: Feature images.
        dims: Length of a feature, D.
        threads: 0 uses one per hardware thread; does not change results.

    Returns:
        [N,D] float32; 0 for Gaussians that no view shows.
    """
    rasterizer, options = Rasterizer(np.float32), RenderOptions(threads=threads)
    sums = np.zeros((gaussian_map.size, dims), np.float32)
    weights = np.zeros((gaussian_map.size, 1), np.float32)
    for camera, features, known in views:
        rasterizer.forward(gaussian_map, camera, options, mask=known)
        lifted = rasterizer.lift(features)
        sums[lifted.rows] += lifted.weighted_features
        weights[lifted.rows, 0] += lifted.weights
    return np.asarray(np.divide(sums, weights, out=sums, where=weights > 0), np.float32)
