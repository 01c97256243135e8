"""Codec of class distributions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gslts.types import Floats32


@dataclass(frozen=True)
class ClassCodec:
    """Codec of class distributions, which Gaussians have as they are.

    Args:
        dims: Number of classes, with "nothing" as the first.
    """

    dims: int

    @property
    def code_dims(self) -> int:
        """Length of a code, d."""
        return self.dims

    def encode(self, embeddings: Floats32) -> Floats32:
        """Return distributions as they are.

        Args:
            embeddings: [S,D] float32.
        """
        return embeddings

    def cosines(self, codes: Floats32, vectors: Floats32) -> Floats32:
        """Return the probabilities of classes.

        Args:
            codes: [S,D] float32, distributions.
            vectors: [V,D] float32, with a 1 for the class of each text.

        Returns:
            [S,V] float32.
        """
        return np.asarray(codes @ vectors.T, np.float32)
