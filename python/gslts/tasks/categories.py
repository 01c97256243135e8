"""What each Gaussian is: the category with the highest relevance, GS-LTS, sec. III-B."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gslts.gaussian_map import GaussianMap
from gslts.tasks.autoencoder import Autoencoder
from gslts.tasks.relevance import CANONICAL, relevance
from gslts.tasks.semantics import SemanticSource

CHUNK = 1 << 14
"""Gaussians that are decoded at a time: embeddings of all of them would take a gigabyte."""


@dataclass(frozen=True, eq=False)
class Categories:
    """What Gaussians may be.

    Attributes:
        names: Of the categories.
        autoencoder: Of the features.
        source: Of words.
    """

    names: tuple[str, ...]
    autoencoder: Autoencoder
    source: SemanticSource


def categories_of(
    gaussian_map: GaussianMap,
    rows: NDArray[np.intp],
    autoencoder: Autoencoder,
    source: SemanticSource,
    names: Sequence[str],
) -> NDArray[np.int32]:
    """[K] the category of each of some Gaussians; -1 where none fits as well as the source asks.

    Args:
        gaussian_map: With features of L * d numbers.
        rows: [K] of its Gaussians.
        autoencoder: Of the features.
        source: Of words.
        names: Of the categories.

    Raises:
        ValueError: The features are not those of the autoencoder, or a name is empty or occurs
            twice.
    """
    if not all(name.strip() for name in names) or len(set(names)) < len(names):
        raise ValueError(f"categories_of: names: one is empty or occurs twice: {list(names)}")
    dims, code = gaussian_map.feature_dims, autoencoder.code
    if dims == 0 or dims % code:
        raise ValueError(
            f"categories_of: the map has {dims} features a Gaussian, which is no multiple of {code}"
        )
    result = np.full(len(rows), -1, np.int32)
    if not names:
        return result
    queries, canonical = source.encode(names), source.encode(CANONICAL)
    for first in range(0, len(rows), CHUNK):
        part = gaussian_map.features[rows[first : first + CHUNK]]
        codes = part.astype(np.float32, copy=False).reshape(-1, code)
        known = (codes != 0).any(axis=1)
        scores = np.zeros((len(names), len(codes)), np.float32)
        decoded = autoencoder.decoded(codes[known])
        for number, query in enumerate(queries):
            scores[number, known] = relevance(decoded, query, canonical)
        best = scores.reshape(len(names), len(part), -1).max(axis=2)
        fits = best.max(axis=0) >= source.threshold
        result[first : first + CHUNK] = np.where(fits, best.argmax(axis=0), -1)
    return result
