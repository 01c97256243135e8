"""Semantic features by gradient, as in GS-LTS, sec. III-A, and LangSplat (Qin et al. 2024)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gslts.core.gaussian_map import GaussianMap
from gslts.rendering.adam import Adam, AdamRates
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.semantics.lift import FeatureView
from gslts.types import Floats32

RATE = 2.5e-3
"""Of Adam, as in LangSplat."""


def refine_features(
    gaussian_map: GaussianMap,
    features: Floats32,
    views: Sequence[FeatureView],
    steps: int,
    seed: int = 0,
    threads: int = 0,
) -> Floats32:
    """Features whose rendering differs less from what views say, by the L1 norm.

    Args:
        gaussian_map: float32; its Gaussians stay where they are.
        features: [N,D] to start from.
        views: Camera, features [H,W,D], and [H,W] where there are any.
        steps: Of Adam, one view each.
        seed: Of the order of the views.
        threads: 0 means one a hardware thread.

    Returns:
        [N,D].
    """
    if steps == 0:
        return features
    rng, options = np.random.default_rng(seed), RenderOptions(threads=threads)
    rasterizer, adam = Rasterizer(np.float32), Adam(replace(gaussian_map, features=features))
    order: list[int] = []
    for _ in range(steps):
        order = order or rng.permutation(len(views)).tolist()
        camera, wanted, known = views[order.pop()]
        found = rasterizer.forward(adam.map, camera, options, mask=known).features
        slope = np.sign(found - wanted) * known[..., None] / max(1, np.count_nonzero(known))
        gradients = rasterizer.backward(dL_dfeatures=slope.astype(np.float32))
        adam.step(gradients, AdamRates(features=RATE), threads=threads)
    return np.array(adam.map.features, np.float32)
