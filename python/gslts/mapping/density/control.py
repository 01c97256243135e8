"""Join maps, split Gaussians, and compute their blending weights in images."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gslts.core.gaussian_map import GaussianMap
from gslts.mapping.observation import Observation
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.types import Floats, Floats32, Ints

SPLIT_OFFSET, SPLIT_SHRINK = 0.7, 1.6
"""Offset of the halves of a split Gaussian in standard deviations, and the factor by which they are
narrower (1.6 as in 3DGS, Kerbl et al. 2023, sec. 5.2)."""


def join(old: GaussianMap, new: GaussianMap, first_id: int | None = None) -> GaussianMap:
    """Join two maps, the new Gaussians last.

    Args:
        old: Gives the origin.
        new: Gaussians in the frame of the old map.
        first_id: First id of the new Gaussians; None means the one after the greatest old id.
    """
    first = old.next_id if first_id is None else first_id
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


def split(gaussian_map: GaussianMap, rows: Ints) -> GaussianMap:
    """Split Gaussians into two halves along their longest axes.

    Args:
        gaussian_map: Any map.
        rows: [M] distinct rows; one half stays there, the other comes last, with a new id.
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
    return join(replace(gaussian_map, means=means, log_scales=log_scales), others)


def axes_of(quats: NDArray[Any]) -> NDArray[Any]:
    """Return the axes [N,3,3] of rotations, one axis per row.

    Args:
        quats: [N,4] wxyz, of any length but 0.
    """
    w, x, y, z = (quats / np.linalg.norm(quats, axis=1, keepdims=True)).T
    return np.stack(
        [
            np.stack([1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)], axis=1),
            np.stack([2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)], axis=1),
            np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], axis=1),
        ],
        axis=1,
    )


def max_weights(
    gaussian_map: GaussianMap, observations: Iterable[Observation], threads: int = 0
) -> Floats32:
    """Compute the maximum blending weight of each Gaussian over all pixels of all frames.

    Without a Gaussian no pixel changes by more than its weight times the difference of two colours.

    Args:
        gaussian_map: float32.
        observations: Frames, rendered at half resolution.
        threads: Number of threads; 0 means all.

    Returns:
        [N] 0 to 1.
    """
    rasterizer, options = Rasterizer(np.float32), RenderOptions(threads=threads)
    largest = np.zeros(gaussian_map.size, np.float32)
    for observation in observations:
        images = rasterizer.forward(gaussian_map, observation.camera(1), options)
        seen = rasterizer.backward(dL_dalpha=np.zeros_like(images.alpha), statistics=True)
        weights = seen.max_weights
        assert weights is not None  # Requested by `statistics`.
        largest[seen.rows] = np.maximum(largest[seen.rows], weights)
    return largest


def total_weights(
    gaussian_map: GaussianMap, observations: Iterable[Observation], threads: int = 0
) -> Floats:
    """Compute the sum of the blending weights of each Gaussian over all pixels of all frames.

    Args:
        gaussian_map: float32.
        observations: Frames, rendered at half resolution.
        threads: Number of threads; 0 means all.

    Returns:
        [N] pixels.
    """
    rasterizer, options = Rasterizer(np.float32), RenderOptions(threads=threads)
    total = np.zeros(gaussian_map.size)
    for observation in observations:
        images = rasterizer.forward(gaussian_map, observation.camera(1), options)
        seen = rasterizer.lift(np.zeros((*images.alpha.shape, 1), np.float32))
        total[seen.rows] += seen.weights
    return total
