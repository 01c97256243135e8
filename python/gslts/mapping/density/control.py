"""How many Gaussians there are: joined, split, and those that nobody would miss."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gslts.core.gaussian_map import GaussianMap
from gslts.mapping.observation import Observation
from gslts.rendering.rasterizer import Rasterizer, RenderOptions

SPLIT_OFFSET, SPLIT_SHRINK = 0.7, 1.6
"""Halves of a Gaussian stand so many standard deviations off its centre, and are narrower by that
(3DGS, Kerbl et al. 2023, sec. 5.2, shrinks by 1.6)."""


def joined(old: GaussianMap, new: GaussianMap, first_id: int | None = None) -> GaussianMap:
    """Both, the new Gaussians last.

    Args:
        old: Of any size.
        new: In the frame of the old map.
        first_id: The new Gaussians get this id and those after it; None means those after the
            greatest of the old map.
    """
    first = first_id
    if first is None:
        first = int(old.ids.max()) + 1 if old.size else 0
    return GaussianMap(
        means=np.concatenate([old.means, new.means]),
        quats=np.concatenate([old.quats, new.quats]),
        log_scales=np.concatenate([old.log_scales, new.log_scales]),
        logit_opacities=np.concatenate([old.logit_opacities, new.logit_opacities]),
        sh=np.concatenate([old.sh, new.sh]),
        features=np.concatenate([old.features, new.features]),
        ids=np.concatenate([old.ids, np.arange(first, first + new.size, dtype=np.uint64)]),
        origin=old.origin,
    )


def split(gaussian_map: GaussianMap, rows: NDArray[np.int64]) -> GaussianMap:
    """These Gaussians become two halves along their longest axes.

    Args:
        gaussian_map: Any map.
        rows: [M] int64, none twice; one half stays there, the other comes last, with a new id.
    """
    parents = gaussian_map.select(rows)
    each, longest = np.arange(parents.size), parents.log_scales.argmax(axis=1)
    axes = axes_of(parents.quats)[each, longest]
    scales_m = np.exp(parents.log_scales[each, longest])
    offset = (SPLIT_OFFSET * scales_m[:, None] * axes).astype(parents.dtype)
    means, log_scales = gaussian_map.means.copy(), gaussian_map.log_scales.copy()
    means[rows] += offset
    log_scales[rows, longest] -= np.log(SPLIT_SHRINK)
    others = replace(parents, means=parents.means - offset, log_scales=log_scales[rows])
    return joined(replace(gaussian_map, means=means, log_scales=log_scales), others)


def axes_of(quats: NDArray[Any]) -> NDArray[Any]:
    """[N,3,3] for quaternions [N,4] the three axes of each, one a row."""
    w, x, y, z = (quats / _lengths(quats)).T
    return np.stack(
        [
            np.stack([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)], axis=1),
            np.stack([2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)], axis=1),
            np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], axis=1),
        ],
        axis=1,
    )


def greatest_weights(
    gaussian_map: GaussianMap, observations: Iterable[Observation], threads: int = 0
) -> NDArray[np.float32]:
    """[N] the greatest share that each Gaussian has in any pixel of the observations.

    A pixel changes by at most that share of the difference of two colours if the Gaussian goes.
    They are looked at with half their resolution.
    """
    rasterizer, options = Rasterizer(np.float32), RenderOptions(threads=threads)
    greatest = np.zeros(gaussian_map.size, np.float32)
    for one in observations:
        images = rasterizer.forward(gaussian_map, one.camera(1), options)
        seen = rasterizer.backward(dL_dalpha=np.zeros_like(images.alpha), statistics=True)
        weights = seen.max_weights
        assert weights is not None  # They were asked for.
        greatest[seen.rows] = np.maximum(greatest[seen.rows], weights)
    return greatest


def total_weights(
    gaussian_map: GaussianMap, observations: Iterable[Observation], threads: int = 0
) -> NDArray[np.float64]:
    """[N] in how many pixels of the observations each Gaussian is seen, as a sum of shares.

    They are looked at with half their resolution.
    """
    rasterizer, options = Rasterizer(np.float32), RenderOptions(threads=threads)
    total = np.zeros(gaussian_map.size)
    for one in observations:
        images = rasterizer.forward(gaussian_map, one.camera(1), options)
        seen = rasterizer.lift(np.zeros((*images.alpha.shape, 1), np.float32))
        total[seen.rows] += seen.weights
    return total


def _lengths(vectors: NDArray[np.floating]) -> NDArray[np.floating]:
    lengths: NDArray[np.floating] = np.linalg.norm(vectors, axis=1, keepdims=True)
    return lengths
