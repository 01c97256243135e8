"""How well a query fits embeddings.

Source: GS-LTS, sec. III-B, which has it from LERF (Kerr et al. 2023).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats32 = NDArray[np.float32]

CANONICAL = ("object", "things", "stuff", "texture")
"""Phrases that fit anything: what fits them better than the query is none of it."""


def relevance(embeddings: Floats32, query: Floats32, canonical: Floats32) -> Floats32:
    """[S] min_j exp(e . q) / (exp(e . q) + exp(e . c_j)), between 0 and 1.

    Args:
        embeddings: [S,D] e, of unit length.
        query: [D] q, of unit length.
        canonical: [J,D] c, of unit length, those of `CANONICAL`.
    """
    fits = embeddings @ query
    anyway = (embeddings @ canonical.T).max(axis=1)  # The least quotient is that of the greatest.
    return np.asarray(1 / (1 + np.exp(anyway - fits)), np.float32)
