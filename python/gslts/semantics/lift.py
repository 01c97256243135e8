"""Semantic features of Gaussians in closed form: the mean of what all pixels say that show them.

A Gaussian's feature minimises sum_p w_p |f - S_p|^2 over the pixels p of all views, w_p its blend
weight there: f = sum_p w_p S_p / sum_p w_p, the transpose of rendering. GS-LTS descends a gradient
to about the same place.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from gslts.core.camera import Camera
from gslts.core.gaussian_map import GaussianMap
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.types import Floats32

FeatureView = tuple[Camera, Floats32, NDArray[np.bool_]]


def lift_features(
    gaussian_map: GaussianMap, views: Iterable[FeatureView], dims: int, threads: int = 0
) -> Floats32:
    """[N,D] features of all Gaussians; 0 for those that no view shows.

    Args:
        gaussian_map: float32.
        views: Camera, features [H,W,D], and [H,W] where there are any.
        dims: Length of a feature, D.
        threads: 0 means one a hardware thread.
    """
    rasterizer, options = Rasterizer(np.float32), RenderOptions(threads=threads)
    sums = np.zeros((gaussian_map.size, dims), np.float32)
    weights = np.zeros((gaussian_map.size, 1), np.float32)
    for camera, features, known in views:
        rasterizer.forward(gaussian_map, camera, options, mask=known)
        one = rasterizer.lift(features)
        sums[one.rows] += one.weighted_features
        weights[one.rows, 0] += one.weights
    return np.asarray(np.divide(sums, weights, out=sums, where=weights > 0), np.float32)
