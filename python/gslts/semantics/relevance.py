"""Relevance scores between text queries and the semantic features of a map."""

from __future__ import annotations

import numpy as np

from gslts.core.gaussian_map import FloatArray, GaussianMap
from gslts.semantics.source import CANONICAL, Codec, SemanticSource
from gslts.types import Floats32

MAX_GAUSSIANS_PER_CHUNK = 1 << 14
"""Number of Gaussians scored at a time. Bounds memory: the hidden layer of the decoder for a whole
map of a million Gaussians would take a gigabyte. Does not change results."""


class RelevanceScorer:
    """Scores the Gaussians of one map against embeddings of text queries.

    Args:
        gaussian_map: With features of L * d numbers, a code per level.
        codec: Decodes the codes.
        source: Encodes the canonical phrases.

    Raises:
        ValueError: The features do not fit the codec, or the codec does not fit the source.
    """

    def __init__(self, gaussian_map: GaussianMap, codec: Codec, source: SemanticSource) -> None:
        dims, code_dims = gaussian_map.feature_dims, codec.code_dims
        if dims == 0 or dims % code_dims:
            raise ValueError(
                f"RelevanceScorer: the features of the map have {dims} dimensions, which is no "
                f"multiple of the code length {code_dims}"
            )
        if source.dims != codec.dims:
            raise ValueError(
                f"RelevanceScorer: the map has semantics of {codec.dims}-D embeddings, the "
                f"source gives {source.dims}-D embeddings"
            )
        self._codec = codec
        self._canonical, self._relevance = source.encode(CANONICAL), source.relevance

    def scores(self, queries: Floats32, features: FloatArray) -> Floats32:
        """Compute the relevance of Gaussians, at the level where each is most relevant.

        Args:
            queries: [Q,D] float32, embeddings of unit length.
            features: [K,L*d] of Gaussians of the map.

        Returns:
            [Q,K] float32, 0 to 1; 0 for Gaussians without a feature at any level.
        """
        result = np.zeros((len(queries), len(features)), np.float32)
        vectors = np.concatenate([queries, self._canonical])
        for first in range(0, len(features), MAX_GAUSSIANS_PER_CHUNK):
            part = features[first : first + MAX_GAUSSIANS_PER_CHUNK]
            codes = part.astype(np.float32, copy=False).reshape(-1, self._codec.code_dims)
            # Without a mask in any view, the code is 0, which decodes to an arbitrary embedding.
            known = codes.any(axis=1)
            cosines = self._codec.cosines(codes[known], vectors)
            scores = np.zeros((len(queries), len(codes)), np.float32)
            for number in range(len(queries)):
                scores[number, known] = self._relevance(
                    cosines[:, number], cosines[:, len(queries) :]
                )
            levels = scores.reshape(len(queries), len(part), -1)
            result[:, first : first + MAX_GAUSSIANS_PER_CHUNK] = levels.max(axis=2)
        return result
