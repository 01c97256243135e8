"""What pictures mean by themselves: the masks of SAM, as CLIP sees them; GS-LTS, sec. III-B."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from gslts.core.frame import RgbdFrame
from gslts.semantics.clip import ClipEncoder
from gslts.semantics.masks import Masks, crop_to_mask, paint_labels
from gslts.semantics.source import LEVELS, Segments
from gslts.types import Floats32


class ClipSource:
    """The variant CLIP of GS-LTS.

    Args:
        encoder: Of pictures and words.
        generator: Gives the masks [K,H,W] of a picture at each level; None is enough for words.
    """

    threshold = 0.5
    """Where a query fits as well as phrases that fit anything (LERF, Kerr et al. 2023). What CLIP
    finds alike differs by a few hundredths of its cosine, so that relevance stays near this value;
    a stricter one would depend on the weights."""

    def __init__(
        self,
        encoder: ClipEncoder,
        generator: Callable[[NDArray[np.uint8]], list[Masks]] | None = None,
    ) -> None:
        self._encoder, self._generator = encoder, generator

    @property
    def dims(self) -> int:
        """Length of an embedding, D."""
        return self._encoder.dims

    def segments(self, frame: RgbdFrame) -> Segments:
        """Three levels of masks; of those that no pixel takes there is no embedding."""
        if self._generator is None:
            raise ValueError("ClipSource: without a SAM it knows words only")
        labels = np.full((LEVELS, *frame.rgb.shape[:2]), -1, np.int32)
        pictures: list[NDArray[np.uint8]] = []
        for level, found in enumerate(self._generator(frame.rgb)):
            masks = found if frame.mask is None else found & frame.mask
            rows, places = np.unique(paint_labels(masks), return_inverse=True)
            shown = rows[rows >= 0]
            # Row -1, if there is one, comes first.
            numbers = np.arange(len(rows)) - (len(rows) - len(shown)) + len(pictures)
            labels[level] = np.where(rows < 0, -1, numbers)[places]
            pictures += [
                crop_to_mask(frame.rgb, masks[row], self._encoder.side_px) for row in shown
            ]
        return Segments(labels, self._encoder.encode_images(pictures))

    def encode(self, texts: Sequence[str]) -> Floats32:
        """[T,D] embeddings of texts, of unit length."""
        return self._encoder.encode_texts(texts)
