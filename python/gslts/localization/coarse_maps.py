"""A map for pictures of few pixels: fewer, larger Gaussians look the same there and cost less.

A random part of the elements, grown to make up for the rest, keeps what a detailed scene looks like
from afar (stochastic simplification, Cook, Halstead, Planck and Ryu, SIGGRAPH 2007).
"""

from __future__ import annotations

import numpy as np

from gslts._core.map import GaussianViewFloat
from gslts.core.gaussian_map import GaussianMap

MOST_THINNED = 8
"""Of so many Gaussians one stays, at least."""


class CoarseMaps:
    """Views of one map for pictures of different sizes, half of the Gaussians for half of the rows.

    Args:
        gaussian_map: float32.
    """

    def __init__(self, gaussian_map: GaussianMap) -> None:
        self._map = gaussian_map
        self._views: dict[int, GaussianViewFloat] = {}

    def halved(self, times: int) -> GaussianViewFloat:
        """For a picture whose sides were halved so often since it was taken."""
        factor = min(2**times, MOST_THINNED)
        if factor not in self._views:
            view = thinned(self._map, factor).view()
            assert isinstance(view, GaussianViewFloat)
            self._views[factor] = view
        return self._views[factor]


def thinned(gaussian_map: GaussianMap, factor: int) -> GaussianMap:
    """One Gaussian of so many, of one colour from all sides, which together fill the same volume.

    Grown to cover the same area, they would hide more of each other, and poses were worse.

    Args:
        gaussian_map: float32 or float64.
        factor: 1 gives the map back.

    Returns:
        A part of the Gaussians, by id, without features.
    """
    if factor == 1:
        return gaussian_map
    order = np.random.default_rng(0).permutation(gaussian_map.size)
    kept = gaussian_map.select(np.sort(order[: gaussian_map.size // factor]))
    return GaussianMap(
        means=kept.means,
        quats=kept.quats,
        log_scales=kept.log_scales + kept.dtype.type(np.log(factor) / 3),
        logit_opacities=kept.logit_opacities,
        sh=kept.sh[:, :1],
        ids=kept.ids,
        origin=kept.origin,
    )
