"""Classification of Gaussians: the category of highest relevance (GS-LTS, sec. III-B)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gslts.core.gaussian_map import GaussianMap
from gslts.semantics.calibration import calibrate
from gslts.semantics.relevance import RelevanceScorer
from gslts.semantics.source import Codec, SemanticSource
from gslts.types import Indices, Ints32


@dataclass(frozen=True, eq=False)
class Categories:
    """Categories for the Gaussians of a map, such as the layers of a 2D semantic map.

    Attributes:
        names: Names of the categories.
        codec: Decodes the features of the map.
        source: Encodes the names.
    """

    names: tuple[str, ...]
    codec: Codec
    source: SemanticSource


def classify_gaussians(
    gaussian_map: GaussianMap,
    rows: Indices,
    codec: Codec,
    source: SemanticSource,
    names: Sequence[str],
) -> Ints32:
    """Assign to Gaussians the category with the highest relevance score.

    Args:
        gaussian_map: With features of L * d numbers.
        rows: [K] rows of the Gaussians to classify.
        codec: Decodes the features.
        source: Encodes the names.
        names: Names of the categories.

    Returns:
        [K] int32, the number of the category; -1 where no score reaches the threshold of a match
        in this map.

    Raises:
        ValueError: The features do not fit the codec, or a name is empty or occurs twice.
    """
    if not all(name.strip() for name in names) or len(set(names)) < len(names):
        raise ValueError(f"classify_gaussians: names: one is empty or occurs twice: {list(names)}")
    scorer = RelevanceScorer(gaussian_map, codec, source)
    if not names:
        return np.full(len(rows), -1, np.int32)
    own, row_of = np.unique(rows, return_inverse=True)
    features = gaussian_map.select(own).features[row_of]
    scores = scorer.scores(source.encode(names), features)
    is_match = scores.max(axis=0) >= calibrate(source, gaussian_map, codec).threshold
    return np.where(is_match, scores.argmax(axis=0), -1).astype(np.int32)
