"""Calibration of a source in a map: the relevance from which a text matches.

Queries, categories, names and navigation take the threshold of the source that `calibrate` returns.
"""

from __future__ import annotations

from copy import copy

import numpy as np

from gslts.core.gaussian_map import GaussianMap
from gslts.semantics.prototypes import Prototypes
from gslts.semantics.relevance import RelevanceScorer
from gslts.semantics.source import Codec, SemanticSource
from gslts.semantics.vocabulary import REJECTED_SHARE

MIN_GAUSSIANS = 12
"""Minimum number of Gaussians of a cluster, and of an object between two pieces."""


def calibrate(
    source: SemanticSource,
    gaussian_map: GaussianMap,
    codec: Codec,
    prototypes: Prototypes | None = None,
) -> SemanticSource:
    """Raise the threshold of a source above what most unrelated texts reach in a map.

    A text reaches the score that enough Gaussians for an object have.

    Args:
        source: Encodes texts.
        gaussian_map: With features.
        codec: Decodes the features.
        prototypes: Of the map; None chooses them.

    Returns:
        A copy with the threshold of this map; the source itself if it has no unrelated texts, as
        one that is calibrated.

    Raises:
        ValueError: The features do not fit the codec, or that does not fit the source.
    """
    if not source.unrelated:
        return source
    calibrated = copy(source)
    calibrated.unrelated = ()
    prototypes = prototypes or Prototypes.of_map(gaussian_map)
    if len(prototypes.counts) == 0:
        return calibrated
    scorer = RelevanceScorer(gaussian_map, codec, source)
    scores = scorer.scores(source.encode(source.unrelated), prototypes.features)
    order = np.argsort(-scores, axis=1)
    counts = np.cumsum(prototypes.counts[order], axis=1)
    enough = np.minimum(MIN_GAUSSIANS, counts[:, -1:])
    last = (counts >= enough).argmax(axis=1)
    reached = np.take_along_axis(scores, order, axis=1)[np.arange(len(last)), last]
    calibrated.threshold = max(source.threshold, float(np.quantile(reached, REJECTED_SHARE)))
    return calibrated
