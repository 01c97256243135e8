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
from gslts.types import Floats32, Ints32

FeatureView = tuple[Camera, Ints32, Floats32]
"""Camera, labels [H,W] of the pixels, -1 for none, and the feature of each label [S,D]."""


def lift_features(
    gaussian_map: GaussianMap, views: Iterable[FeatureView], dims: int, threads: int = 0
) -> Floats32:
    """Compute the features of all Gaussians from labelled images.

    Args:
        gaussian_map: float32.
        views: Labels and their features; numbers that are 0 for all labels of a view cost nothing.
        dims: Length of a feature, D.
        threads: 0 uses one per hardware thread; does not change results.

    Returns:
        [N,D] float32; 0 for Gaussians that no view shows.
    """
    rasterizer, options = Rasterizer(np.float32), RenderOptions(threads=threads)
    sums = np.zeros((gaussian_map.size, dims), np.float32)
    weights = np.zeros((gaussian_map.size, 1), np.float32)
    for camera, labels, features in views:
        columns = np.flatnonzero(features.any(axis=0))
        rasterizer.forward(gaussian_map, camera, options, mask=labels >= 0)
        lifted = rasterizer.lift(features[:, columns][labels])
        sums[np.ix_(lifted.rows, columns)] += lifted.weighted_features
        weights[lifted.rows, 0] += lifted.weights
    return np.asarray(np.divide(sums, weights, out=sums, where=weights > 0), np.float32)
