"""Semantic features of Gaussians in closed form, by back-projection with the blending weights.

The feature of a Gaussian minimizes `sum_p w_p |f - S_p|^2` over the pixels p of all views, where
w_p is its blending weight at p and S_p the feature of the pixel: `f = sum_p w_p S_p / sum_p w_p`,
the transpose of rendering. GS-LTS reaches about the same features by gradient descent (`refine`).

Class distributions of a detector are means over views instead, because its errors are errors of
whole views: a view counts w / (w + 1) for a Gaussian with the sum of weights w in it, and each
Gaussian starts as "nothing" in `PRIOR_VIEWS` views.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from gslts.core.camera import Camera
from gslts.core.gaussian_map import GaussianMap
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.semantics.class_codec import ClassCodec
from gslts.semantics.source import Codec
from gslts.types import Floats32, Indices, Ints32, UInts32

FeatureView = tuple[Camera, Ints32, Floats32]
"""Camera, labels [H,W] of the pixels, -1 for none, and the feature of each label [S,D]."""
PRIOR_VIEWS = 4.0
"""Number of views in which a Gaussian counts as "nothing" before it was seen: a single detection of
score 0.6 is below the threshold of a query then. With none, false detections of surfaces that few
views show are objects; at double, what ten views show is hardly found."""


def lift_codes(
    gaussian_map: GaussianMap, views: Iterable[FeatureView], codec: Codec, threads: int = 0
) -> Floats32:
    """Compute the features of all Gaussians from labelled images, as fits their codec.

    Args:
        gaussian_map: float32.
        views: Labels and their codes.
        codec: Of the codes.
        threads: 0 uses one per hardware thread; does not change results.

    Returns:
        [N,d] float32; 0 for Gaussians that no view shows.
    """
    if not isinstance(codec, ClassCodec):
        return lift_features(gaussian_map, views, codec.code_dims, threads)
    sums = np.zeros((gaussian_map.size, codec.code_dims), np.float32)
    for rows, columns, features, weights in _lift_views(gaussian_map, views, threads):
        sums[np.ix_(rows, columns)] += features / (weights[:, None] + 1)
    totals = sums.sum(axis=1, keepdims=True)
    sums[:, 0] += np.where(totals[:, 0] > 0, PRIOR_VIEWS, 0)
    return np.asarray(sums / np.where(totals > 0, totals + PRIOR_VIEWS, 1), np.float32)


def lift_features(
    gaussian_map: GaussianMap, views: Iterable[FeatureView], dims: int, threads: int = 0
) -> Floats32:
    """Compute the features of all Gaussians from labelled images, as means over pixels.

    Args:
        gaussian_map: float32.
        views: Labels and their features.
        dims: Length of a feature, D.
        threads: 0 uses one per hardware thread; does not change results.

    Returns:
        [N,D] float32; 0 for Gaussians that no view shows.
    """
    sums = np.zeros((gaussian_map.size, dims), np.float32)
    totals = np.zeros((gaussian_map.size, 1), np.float32)
    for rows, columns, features, weights in _lift_views(gaussian_map, views, threads):
        sums[np.ix_(rows, columns)] += features
        totals[rows, 0] += weights
    return np.asarray(np.divide(sums, totals, out=sums, where=totals > 0), np.float32)


def _lift_views(
    gaussian_map: GaussianMap, views: Iterable[FeatureView], threads: int
) -> Iterator[tuple[UInts32, Indices, Floats32, Floats32]]:
    """Lift views: rows [V] of Gaussians, columns [C], weighted features [V,C], weights [V].

    Columns that are 0 for all labels of a view are left out.
    """
    rasterizer, options = Rasterizer(np.float32), RenderOptions(threads=threads)
    for camera, labels, features in views:
        columns = np.flatnonzero(features.any(axis=0))
        rasterizer.forward(gaussian_map, camera, options, mask=labels >= 0)
        lifted = rasterizer.lift(features[:, columns][labels])
        weighted = np.asarray(lifted.weighted_features, np.float32)
        yield lifted.rows, columns, weighted, np.asarray(lifted.weights, np.float32)
