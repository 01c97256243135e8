"""Where the meaning of a picture comes from: masks with embeddings, and words in the same space."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from gslts.core.frame import RgbdFrame
from gslts.types import Floats32

LEVELS = 3
"""Of masks, at most, as in LangSplat: wholes, parts and parts of parts."""


@dataclass(frozen=True, eq=False)
class Segments:
    """The masks of a picture.

    Args:
        labels: [L,H,W] int32, row of the mask in `embeddings` at each of L levels; -1 for none.
        embeddings: [S,D] float32, of unit length.
        names: [S] what each mask shows, where the source has words for it; or none.

    Raises:
        ValueError: An array has a wrong shape or dtype, or a label has no embedding.
    """

    labels: NDArray[np.int32]
    embeddings: Floats32
    names: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        labels, embeddings = self.labels, self.embeddings
        if labels.dtype != np.int32 or labels.ndim != 3 or not 1 <= len(labels) <= LEVELS:
            raise ValueError(
                f"Segments: labels: expected int32 [1..{LEVELS},H,W], got {labels.dtype} "
                f"{labels.shape}"
            )
        if embeddings.dtype != np.float32 or embeddings.ndim != 2:
            raise ValueError(
                f"Segments: embeddings: expected float32 [S,D], got {embeddings.dtype} "
                f"{embeddings.shape}"
            )
        if labels.size and not (labels.min() >= -1 and labels.max() < len(embeddings)):
            raise ValueError(f"Segments: labels: must be in -1..{len(embeddings) - 1}")


class SemanticSource(Protocol):
    """Tells what pictures show, and puts words into the same space."""

    @property
    def dims(self) -> int:
        """Length of an embedding, D."""
        ...

    @property
    def threshold(self) -> float:
        """Relevance, 0 to 1, from which on a query fits what it is asked of."""
        ...

    def segments(self, frame: RgbdFrame) -> Segments:
        """The masks of a frame.

        Raises:
            ValueError: The frame has not what this source needs.
        """
        ...

    def encode(self, texts: Sequence[str]) -> Floats32:
        """[T,D] embeddings of texts, of unit length."""
        ...


class Oracle:
    """The truth of a simulator or of a person: the labels of frames, the variant GT of GS-LTS.

    Each type of object has an embedding of its own, drawn from its name, so that two runs agree;
    those of different names are nearly orthogonal.
    """

    dims = 512
    threshold = 0.62

    def segments(self, frame: RgbdFrame) -> Segments:
        """One level: the objects, each with the embedding of its type."""
        if frame.labels is None:
            raise ValueError("Oracle: the frame has no labels; recordings of gslts sim have")
        types = sorted(set(frame.labels.types))
        row_of = {name: row for row, name in enumerate(types)}
        rows = np.array([*(row_of[name] for name in frame.labels.types), -1], np.int32)
        return Segments(rows[frame.labels.instances][None], self.encode(types), tuple(types))

    def encode(self, texts: Sequence[str]) -> Floats32:
        """Embeddings of names; capitals and spaces do not count, as in "alarm clock"."""
        return np.array([_drawn(text, self.dims) for text in texts], np.float32).reshape(
            len(texts), self.dims
        )


def _drawn(name: str, dims: int) -> NDArray[np.float64]:
    plain = "".join(name.split()).casefold()
    seed = int.from_bytes(hashlib.sha256(plain.encode()).digest()[:8], "big")
    drawn = np.random.default_rng(seed).normal(size=dims)
    return np.asarray(drawn / np.linalg.norm(drawn))
