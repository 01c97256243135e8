"""Prototypes: a few Gaussians of each chunk, whose semantic features stand for those of all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gslts._core.map import CHUNK_SIZE
from gslts.core.farthest_points import farthest_points
from gslts.core.gaussian_map import GaussianMap
from gslts.types import Floats32, Indices

MIN_OPACITY = 0.3
"""Minimum opacity of Gaussians with a meaning; others are hardly visible."""
MAX_OF_CHUNK, APART = 32, 0.1
"""Maximum number of prototypes of a chunk, and their minimum distance as features: codes and class
distributions are at most 1 long. In a simulated living room, the relevance of a Gaussian differs
from that of its prototype by at most 0.02 in nine of ten chunks."""


@dataclass(frozen=True, eq=False)
class Prototypes:
    """Gaussians with the most different features of each chunk of a map.

    Attributes:
        features: [P,L*d] float32.
        chunks: [P] chunk of each one.
        counts: [P] number of Gaussians of its chunk that are most like it, itself included.
    """

    features: Floats32
    chunks: Indices
    counts: Indices

    @classmethod
    def of_map(cls, gaussian_map: GaussianMap) -> Prototypes:
        """Choose the prototypes of a map; all of it is read, and not kept in memory.

        Args:
            gaussian_map: With features.
        """
        features = [np.zeros((0, gaussian_map.feature_dims), np.float32)]
        chunks, counts = [np.zeros(0, np.intp)], [np.zeros(0, np.intp)]
        for rows, part in gaussian_map.parts():
            own = part.features[meaningful_rows(part)].astype(np.float32, copy=False)
            if len(own) == 0:
                continue
            chosen = own[farthest_points(own, MAX_OF_CHUNK, APART)]
            squares = (chosen**2).sum(axis=1) - 2 * own @ chosen.T  # Less those of `own`.
            counts.append(np.bincount(squares.argmin(axis=1), minlength=len(chosen)))
            chunks.append(np.full(len(chosen), rows.start // CHUNK_SIZE))
            features.append(chosen)
        return cls(np.concatenate(features), np.concatenate(chunks), np.concatenate(counts))


def meaningful_rows(part: GaussianMap) -> Indices:
    """Return the Gaussians that are neither transparent nor without features.

    Args:
        part: Of a map with features.

    Returns:
        [M] rows, ascending.
    """
    opacities = 1 / (1 + np.exp(-part.logit_opacities))
    return np.flatnonzero((opacities >= MIN_OPACITY) & part.features.any(axis=1))
