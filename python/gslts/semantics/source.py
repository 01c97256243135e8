"""Semantic sources: segmentation of frames, and embeddings of segments and texts in one space."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from gslts.core.frame import RgbdFrame
from gslts.types import Floats, Floats32, Ints32

CANONICAL = ("object", "things", "stuff", "texture")
"""Canonical phrases of LERF: what matches one of them better than the query does not match it."""
MAX_LEVELS = 3
"""Maximum number of levels of masks, those of SAM: wholes, parts and sub-parts (LangSplat)."""


@dataclass(frozen=True, eq=False)
class Segments:
    """Segmentation of a frame, with an embedding for each mask.

    Args:
        labels: [L,H,W] int32, for each of L levels the row of the pixel's mask in `embeddings`; -1
            for none.
        embeddings: [S,D] float32, of unit length.
        names: [S] names of the masks; empty if the source has no names.

    Raises:
        ValueError: An array has a wrong shape or dtype, or a label has no embedding.
    """

    labels: Ints32
    embeddings: Floats32
    names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        labels, embeddings = self.labels, self.embeddings
        if labels.dtype != np.int32 or labels.ndim != 3 or not 1 <= len(labels) <= MAX_LEVELS:
            raise ValueError(
                f"Segments: labels: expected int32 [1..{MAX_LEVELS},H,W], got {labels.dtype} "
                f"{labels.shape}"
            )
        if embeddings.dtype != np.float32 or embeddings.ndim != 2:
            raise ValueError(
                f"Segments: embeddings: expected float32 [S,D], got {embeddings.dtype} "
                f"{embeddings.shape}"
            )
        if labels.size and not (labels.min() >= -1 and labels.max() < len(embeddings)):
            raise ValueError(f"Segments: labels: must be in -1..{len(embeddings) - 1}")


def relevance(to_query: Floats32, to_canonical: Floats32) -> Floats32:
    """Compute relevance scores: min_j exp(e.q) / (exp(e.q) + exp(e.c_j)).

    Source: GS-LTS, sec. III-B, equation 3, which follows LERF (Kerr et al. 2023).

    Args:
        to_query: [S] float32, cosines e.q of embeddings e with the embedding of the query.
        to_canonical: [S,J] float32, cosines e.c_j with the embeddings of `CANONICAL`.

    Returns:
        [S] float32, between 0 and 1.
    """
    largest = to_canonical.max(axis=1)  # It gives the smallest quotient.
    return np.asarray(1 / (1 + np.exp(largest - to_query)), np.float32)


class Codec(Protocol):
    """Converts embeddings to the codes that Gaussians have as features, and scores codes."""

    @property
    def dims(self) -> int:
        """Length of an embedding, D."""
        ...

    @property
    def code_dims(self) -> int:
        """Length of a code, d."""
        ...

    def encode(self, embeddings: Floats32) -> Floats32:
        """Encode embeddings.

        Args:
            embeddings: [S,D] float32.

        Returns:
            [S,d] float32.
        """
        ...

    def cosines(self, codes: Floats32, vectors: Floats32) -> Floats32:
        """Compute the products of the embeddings of codes with vectors.

        Args:
            codes: [S,d] float32, also weighted means of codes.
            vectors: [V,D] float32, such as embeddings of texts.

        Returns:
            [S,V] float32.
        """
        ...


class SemanticSource(Protocol):
    """Segments frames, and embeds segments and texts in one space.

    Attributes:
        threshold: Minimum relevance score of a match, 0 to 1.
        unrelated: Texts that match nothing, by which `calibrate` raises the threshold in a map;
            empty if it needs none.
    """

    threshold: float
    unrelated: tuple[str, ...]

    @property
    def dims(self) -> int:
        """Length of an embedding, D."""
        ...

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all its classes; empty if it has no fixed ones."""
        ...

    @property
    def codec(self) -> Codec | None:
        """Codec of the embeddings; None if it is trained on those of a map."""
        ...

    def segments(self, frame: RgbdFrame) -> Segments:
        """Segment a frame.

        Args:
            frame: The frame.

        Returns:
            Masks and their embeddings.

        Raises:
            ValueError: The frame lacks data that this source needs.
        """
        ...

    def encode(self, texts: Sequence[str]) -> Floats32:
        """Embed texts.

        Args:
            texts: Such as names of objects.

        Returns:
            [T,D] float32, of unit length.
        """
        ...

    def relevance(self, to_query: Floats32, to_canonical: Floats32) -> Floats32:
        """Compute relevance scores.

        Args:
            to_query: [S] float32, products of embeddings with that of a query.
            to_canonical: [S,J] float32, products with the embeddings of `CANONICAL`.

        Returns:
            [S] float32, between 0 and 1.
        """
        ...

    def explain(self, text: str) -> str:
        """Explain how a text is understood, if not as it is.

        Args:
            text: Such as "mug".

        Returns:
            A sentence for the user; empty if there is nothing to explain.
        """
        ...


class Oracle:
    """Source of ground-truth labels, of a simulator or a person: the variant GT of GS-LTS.

    The embedding of an object type is random, with a seed from its name: the same in all runs, and
    nearly orthogonal for different names.
    """

    dims = 512
    """As CLIP ViT-B."""
    names = ()
    codec = None
    """An autoencoder is trained on the embeddings."""
    relevance = staticmethod(relevance)
    unrelated: tuple[str, ...] = ()
    threshold = 0.62
    """Between the relevance of the right name, about 1 / (1 + exp(-1)) = 0.73, and that of another,
    about 0.5."""

    def segments(self, frame: RgbdFrame) -> Segments:
        """Return one level of masks: the objects, with the embeddings of their types.

        Args:
            frame: With labels.

        Returns:
            Masks, embeddings and names, one for each type.

        Raises:
            ValueError: The frame has no labels.
        """
        if frame.labels is None:
            raise ValueError(
                "Oracle: the frame has no labels, which only recordings of gslts sim have; a "
                "detector (--model, --names) or CLIP and SAM (--clip, --sam) find words in images"
            )
        types = sorted(set(frame.labels.types))
        row_of = {name: row for row, name in enumerate(types)}
        rows = np.array([*(row_of[name] for name in frame.labels.types), -1], np.int32)
        return Segments(rows[frame.labels.instances][None], self.encode(types), tuple(types))

    def encode(self, texts: Sequence[str]) -> Floats32:
        """Embed names; case and spaces are ignored, as in "alarm clock" and "AlarmClock".

        Args:
            texts: Names of object types.

        Returns:
            [T,D] float32, of unit length.
        """
        return np.array(
            [_random_unit_vector(text, self.dims) for text in texts], np.float32
        ).reshape(len(texts), self.dims)

    def explain(self, text: str) -> str:  # noqa: ARG002
        """Explain nothing: texts are names.

        Args:
            text: Not used.
        """
        return ""


def _random_unit_vector(name: str, dims: int) -> Floats:
    key = "".join(name.split()).casefold()
    seed = int.from_bytes(hashlib.sha256(key.encode()).digest()[:8], "big")
    vector = np.random.default_rng(seed).normal(size=dims)
    return np.asarray(vector / np.linalg.norm(vector))
