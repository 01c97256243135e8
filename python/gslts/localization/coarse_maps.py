"""Maps of fewer, larger Gaussians for coarse images, which look the same there and cost less.

A random part of the elements, grown to make up for the rest, preserves the appearance of a detailed
scene at a distance (stochastic simplification, Cook, Halstead, Planck and Ryu, SIGGRAPH 2007).
"""

from __future__ import annotations

import numpy as np

from gslts._core.map import GaussianViewFloat
from gslts.core.gaussian_map import GaussianMap
from gslts.localization.constants import MAX_THINNING


class CoarseMaps:
    """Views of one map for images of different sizes, with half of the Gaussians per halving.

    Args:
        gaussian_map: float32.
    """

    def __init__(self, gaussian_map: GaussianMap) -> None:
        self._map = gaussian_map
        self._views: dict[int, GaussianViewFloat] = {}

    def for_level(self, halvings: int) -> GaussianViewFloat:
        """Return the map for an image whose sides were halved so many times.

        Args:
            halvings: 0 for the full map.
        """
        factor = min(2**halvings, MAX_THINNING)
        if factor not in self._views:
            view = thin(self._map, factor).view()
            assert isinstance(view, GaussianViewFloat)
            self._views[factor] = view
        return self._views[factor]


def thin(gaussian_map: GaussianMap, factor: int) -> GaussianMap:
    """Keep one Gaussian of `factor`, grown so that all together fill the same volume.

    Grown to the same area instead, they would hide more of each other, and poses were worse.

    Args:
        gaussian_map: float32 or float64.
        factor: Number of Gaussians of which one is kept; 1 returns the map itself.

    Returns:
        The kept Gaussians in their order, with one colour from all sides and without features.
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
