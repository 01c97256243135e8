"""How well the Gaussians of a map fit words."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gslts.core.gaussian_map import GaussianMap
from gslts.semantics.autoencoder import Autoencoder
from gslts.semantics.relevance import CANONICAL, relevance
from gslts.semantics.source import SemanticSource
from gslts.types import Floats32

CHUNK = 1 << 14
"""Gaussians that are asked at a time: the hidden layer of all of them would take a gigabyte."""


class Fits:
    """Tells how well the Gaussians of one map fit embeddings of words.

    Args:
        gaussian_map: With features of L * d numbers.
        autoencoder: Of the features.
        source: Of words.

    Raises:
        ValueError: The features are not those of the autoencoder, or it is not that of the source.
    """

    def __init__(
        self, gaussian_map: GaussianMap, autoencoder: Autoencoder, source: SemanticSource
    ) -> None:
        dims, code = gaussian_map.feature_dims, autoencoder.code
        if dims == 0 or dims % code:
            raise ValueError(
                f"Fits: the map has {dims} features a Gaussian, which is no multiple of {code}"
            )
        if source.dims != autoencoder.dims:
            raise ValueError(
                f"Fits: the map was taught with embeddings of {autoencoder.dims} numbers, those "
                f"of the source have {source.dims}"
            )
        self._features, self._autoencoder = gaussian_map.features, autoencoder
        self._canonical = source.encode(CANONICAL)

    def of(self, queries: Floats32, rows: NDArray[np.intp]) -> Floats32:
        """[Q,K] relevance of embeddings [Q,D], 0 to 1, at the level where a Gaussian fits best.

        Args:
            queries: Of unit length.
            rows: [K] Gaussians of the map. What has no meaning at any level fits nothing: 0.
        """
        found = np.zeros((len(queries), len(rows)), np.float32)
        vectors = np.concatenate([queries, self._canonical])
        for first in range(0, len(rows), CHUNK):
            part = self._features[rows[first : first + CHUNK]]
            codes = part.astype(np.float32, copy=False).reshape(-1, self._autoencoder.code)
            # A level at which no view showed a mask has code 0, which decodes to anything.
            known = codes.any(axis=1)
            cosines = self._autoencoder.cosines(codes[known], vectors)
            scores = np.zeros((len(queries), len(codes)), np.float32)
            for number in range(len(queries)):
                scores[number, known] = relevance(cosines[:, number], cosines[:, len(queries) :])
            levels = scores.reshape(len(queries), len(part), -1)
            found[:, first : first + CHUNK] = levels.max(axis=2)
        return found
