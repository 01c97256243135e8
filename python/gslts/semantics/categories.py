"""What each Gaussian is: the category with the highest relevance, GS-LTS, sec. III-B."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gslts.core.gaussian_map import GaussianMap
from gslts.semantics.autoencoder import Autoencoder
from gslts.semantics.relevance import RelevanceScorer
from gslts.semantics.source import SemanticSource


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


def classify_gaussians(
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
        raise ValueError(f"classify_gaussians: names: one is empty or occurs twice: {list(names)}")
    fits = RelevanceScorer(gaussian_map, autoencoder, source)
    if not names:
        return np.full(len(rows), -1, np.int32)
    found = fits.scores(source.encode(names), rows)
    fitting = found.max(axis=0) >= source.threshold
    return np.where(fitting, found.argmax(axis=0), -1).astype(np.int32)
