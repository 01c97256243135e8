"""How well a query fits embeddings.

Source: GS-LTS, sec. III-B, which has it from LERF (Kerr et al. 2023).
"""

from __future__ import annotations

import numpy as np

from gslts.types import Floats32

CANONICAL = ("object", "things", "stuff", "texture")
"""Phrases that fit anything: what fits them better than the query is none of it."""


def relevance(to_query: Floats32, to_canonical: Floats32) -> Floats32:
    """[S] min_j exp(e . q) / (exp(e . q) + exp(e . c_j)), between 0 and 1.

    Args:
        to_query: [S] e . q of embeddings e with that of the query, all of unit length.
        to_canonical: [S,J] e . c with those of `CANONICAL`.
    """
    anyway = to_canonical.max(axis=1)  # The least quotient is that of the greatest.
    return np.asarray(1 / (1 + np.exp(anyway - to_query)), np.float32)
