"""Merge neighbouring Gaussians where that changes the images least."""

from __future__ import annotations

import numpy as np

from gslts.core.gaussian_map import SH_C0, FloatArray, GaussianMap
from gslts.core.se3 import quats_of_rotations
from gslts.mapping.density.control import axes_of
from gslts.mapping.density.mixture import Splats, mixture
from gslts.mapping.seeding.point_seeds import nearest
from gslts.types import Bools, Floats, Ints

NEIGHBOURS = 8
"""Nearest Gaussians that each may merge with."""
ROUND_SHARE = 0.5
"""Share of the independent pairs, cheapest first, that is merged per round: the others may find
better partners among the merged."""
MIN_VARIANCE_M2 = 1e-14
"""Minimum variance of a merged Gaussian, m2; smaller ones are rounding errors."""
SPREAD_M = 1e-4
"""Standard deviation of the motion of Gaussians, m, more than `NEIGHBOURS` of which have the same
position, in the search for neighbours only: more than the rounding of float32 in a building."""
CHUNK = 1 << 14
"""Pairs per batch, so that their matrices stay in the cache; changes speed only."""


def merge(gaussian_map: GaussianMap, count: int, weights: FloatArray | None = None) -> GaussianMap:
    """Merge pairs of neighbours until a number of Gaussians is left.

    In each of several rounds a Gaussian merges with at most one other, cheapest pairs first. The
    merged Gaussian has the mean, covariance, mean colours and mean features of the two, an opacity
    that covers the same area, and the id and row of the one of greater weight.

    Args:
        gaussian_map: Any map.
        count: Number of Gaussians left, at least 1 unless the map is empty. A map that has no more
            is returned unchanged.
        weights: [N] sums of blending weights over all pixels: unseen Gaussians merge at no cost.
            None weighs each m2 of a surface equally.

    Raises:
        ValueError: count is too small, or weights are not [N], finite and not negative.
    """
    if count < min(1, gaussian_map.size):
        raise ValueError(f"merge: count: expected at least 1, got {count}")
    if weights is not None:
        if weights.shape != (gaussian_map.size,):
            raise ValueError(f"merge: weights: expected [{gaussian_map.size}], got {weights.shape}")
        if not (np.isfinite(weights).all() and (weights >= 0).all()):
            raise ValueError("merge: weights: expected finite values of at least 0")
    if gaussian_map.size <= count:
        return gaussian_map
    splats = _splats_of(gaussian_map, weights)
    left, changed = _reduce(splats, count)
    return _map_of(gaussian_map, splats, left, changed)


def _splats_of(gaussian_map: GaussianMap, weights: FloatArray | None) -> Splats:
    size = gaussian_map.size
    axes = axes_of(gaussian_map.quats.astype(np.float64))
    scaled = axes * np.exp(gaussian_map.log_scales.astype(np.float64))[:, :, None]
    opacities = 1 / (1 + np.exp(-gaussian_map.logit_opacities.astype(np.float64)))
    sh, features = gaussian_map.sh.reshape(size, -1), gaussian_map.features
    # Copies, which change from round to round.
    return Splats.of(
        gaussian_map.means.astype(np.float64),
        scaled.transpose(0, 2, 1) @ scaled,
        opacities,
        None if weights is None else np.array(weights, np.float64),
        SH_C0 * sh.astype(np.float64),
        features.astype(np.float64),
    )


def _reduce(splats: Splats, count: int) -> tuple[Ints, Ints]:
    """Merge in place; return the rows that are left, and those of them that have changed."""
    size = len(splats.means)
    left, changed = np.ones(size, np.bool_), np.zeros(size, np.bool_)
    pairs, costs = np.zeros((0, 2), np.int64), np.zeros(0)
    while (surplus := int(left.sum()) - count) > 0:
        if len(pairs) == 0:
            rows = np.flatnonzero(left)
            pairs = rows[_near_pairs(splats.means[rows])]
            costs = _costs(splats, pairs)
        order = np.argsort(costs, kind="stable")
        free = order[_independent(pairs[order], size)]
        first, second = pairs[free[: min(surplus, int(np.ceil(ROUND_SHARE * len(free))))]].T
        heavier = splats.weights[first] >= splats.weights[second]
        kept, gone = np.where(heavier, first, second), np.where(heavier, second, first)
        _merge(splats, kept, gone)
        left[gone], changed[kept] = False, True
        labels = np.arange(size)
        labels[gone] = kept
        pairs = np.sort(labels[pairs], axis=1)
        _, places = np.unique(pairs @ np.array([size, 1]), return_index=True)
        places = places[pairs[places, 0] < pairs[places, 1]]
        pairs, costs = pairs[places], costs[places]
        new = np.zeros(size, np.bool_)
        new[kept] = True
        stale = new[pairs].any(axis=1)
        costs[stale] = _costs(splats, pairs[stale])
    return np.flatnonzero(left), np.flatnonzero(left & changed)


def _near_pairs(points: Floats) -> Ints:
    """Return pairs [P,2] of neighbours, each once, lower row first."""
    count = min(NEIGHBOURS + 1, len(points))
    neighbours, squares = nearest(points, count)
    crowded = squares[:, -1:] == 0
    if crowded.any():  # All of a crowd would have the same few neighbours.
        motion = np.random.default_rng(0).normal(0, SPREAD_M, points.shape)
        neighbours = nearest(points + crowded * motion, count)[0]
    rows = np.repeat(np.arange(len(points)), neighbours.shape[1])
    pairs = np.sort(np.column_stack([rows, neighbours.ravel()]), axis=1)
    pairs = pairs[pairs[:, 0] < pairs[:, 1]]
    keys = np.sort(pairs @ np.array([len(points), 1]))
    keys = keys[np.diff(keys, prepend=-1) > 0]
    return np.column_stack(np.divmod(keys, len(points)))


def _costs(splats: Splats, pairs: Ints) -> Floats:
    parts = [
        mixture(splats.take(part[:, 0]), splats.take(part[:, 1])).costs
        for part in np.split(pairs, range(CHUNK, len(pairs), CHUNK))
    ]
    return np.concatenate(parts)


def _independent(pairs: Ints, size: int) -> Bools:
    """Return which pairs [P] share no Gaussian with an earlier pair."""
    ranks = np.arange(len(pairs))
    best = np.full(size, len(pairs))
    for side in (0, 1):
        np.minimum.at(best, pairs[:, side], ranks)
    return np.asarray((best[pairs] == ranks[:, None]).all(axis=1))


def _merge(splats: Splats, kept: Ints, gone: Ints) -> None:
    a, b = splats.take(kept), splats.take(gone)
    both = mixture(a, b)
    of_a, of_b = both.shares[:, None], 1 - both.shares[:, None]
    splats.put(
        kept,
        Splats.of(
            both.means,
            both.covars,
            both.opacities,
            a.weights + b.weights,
            of_a * a.colors + of_b * b.colors,
            of_a * a.features + of_b * b.features,
        ),
    )


def _map_of(gaussian_map: GaussianMap, splats: Splats, left: Ints, changed: Ints) -> GaussianMap:
    """Return the map of the rows left; unchanged Gaussians keep their values to the last bit."""
    new = splats.take(changed)
    variances, axes = np.linalg.eigh(new.covars)
    axes[:, :, 0] *= np.linalg.det(axes)[:, None]  # A rotation, not a reflection.
    arrays = {
        "means": new.means,
        "quats": quats_of_rotations(axes),
        "log_scales": 0.5 * np.log(np.maximum(variances, MIN_VARIANCE_M2)),
        "logit_opacities": np.log(new.opacities / (1 - new.opacities)),
        "sh": (new.colors / SH_C0).reshape(-1, *gaussian_map.sh.shape[1:]),
        "features": new.features,
    }
    whole = {}
    for name, values in arrays.items():
        whole[name] = getattr(gaussian_map, name).copy()
        whole[name][changed] = values
    return GaussianMap(**whole, ids=gaussian_map.ids, origin=gaussian_map.origin).select(left)
