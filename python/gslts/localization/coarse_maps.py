"""Maps of fewer, larger Gaussians for coarse images, which look the same there and cost less.

A random part of the elements, grown to make up for the rest, preserves the appearance of a detailed
scene at a distance (stochastic simplification, Cook, Halstead, Planck and Ryu, SIGGRAPH 2007).
"""

from __future__ import annotations

import numpy as np

from gslts._core.map import CHUNK_SIZE, GaussianViewFloat
from gslts.core.chunks import Arrays, Chunks
from gslts.core.gaussian_map import ROW_ARRAYS, GaussianMap
from gslts.core.id_runs import IdRuns
from gslts.localization.constants import MAX_THINNING


class CoarseMaps:
    """Views of one map for images of different sizes, with half of the Gaussians per halving.

    Args:
        gaussian_map: float32; its features are not used.
    """

    def __init__(self, gaussian_map: GaussianMap) -> None:
        self._map = gaussian_map.without_features()
        self._views: dict[int, GaussianViewFloat] = {}

    def for_level(self, halvings: int) -> GaussianViewFloat:
        """Return the map for an image whose sides were halved so many times.

        Args:
            halvings: 0 for the full map.
        """
        factor = min(2**halvings, MAX_THINNING)
        if factor not in self._views:
            view = thin(self._map, factor).view(whole=False)
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
        The kept Gaussians in their order, with one colour from all sides, without features and with
        ids 0, 1, ...; as many of each chunk, so that chunks in view are read alone.
    """
    if factor == 1:
        return gaussian_map
    size, chunks = gaussian_map.size, gaussian_map.chunks
    offsets = np.sort(np.random.default_rng(0).permutation(CHUNK_SIZE)[: CHUNK_SIZE // factor])

    def kept(first_chunk: int, last_chunk: int) -> GaussianMap:
        starts = np.arange(first_chunk, last_chunk) * CHUNK_SIZE
        rows = (starts[:, None] + offsets).ravel()
        return _grow(gaussian_map.select(rows[rows < size]), factor)

    if chunks is None:
        return kept(0, -(-size // CHUNK_SIZE))
    starts = np.arange(0, len(chunks.boxes), factor)
    low = np.minimum.reduceat(chunks.boxes[:, 0], starts)
    high = np.maximum.reduceat(chunks.boxes[:, 1], starts)
    rest = np.searchsorted(offsets, size % CHUNK_SIZE)
    count = size // CHUNK_SIZE * len(offsets) + int(rest)
    coarse = Chunks(
        ids=IdRuns(count, np.zeros(1, np.intp), np.zeros(1, np.uint64)),
        layout=_arrays(kept(0, 0)),
        boxes=np.stack([low, high], axis=1),
        max_log_scales=np.maximum.reduceat(chunks.max_log_scales, starts) + np.log(factor) / 3,
        read=lambda chunk: _arrays(kept(chunk * factor, (chunk + 1) * factor)),
        read_features=lambda chunk: np.zeros((min(CHUNK_SIZE, count - chunk * CHUNK_SIZE), 0)),
    )
    return GaussianMap.of_chunks(coarse, gaussian_map.origin)


def _grow(kept: GaussianMap, factor: int) -> GaussianMap:
    """Return every `factor`-th Gaussian of a map, grown to fill the volume of all."""
    return GaussianMap(
        means=kept.means,
        quats=kept.quats,
        log_scales=kept.log_scales + kept.dtype.type(np.log(factor) / 3),
        logit_opacities=kept.logit_opacities,
        sh=kept.sh[:, :1],
        origin=kept.origin,
    )


def _arrays(gaussian_map: GaussianMap) -> Arrays:
    return {name: getattr(gaussian_map, name) for name in ROW_ARRAYS}
