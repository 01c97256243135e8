"""Segment Anything (Kirillov et al. 2023): all masks of an image, from a grid of point prompts.

The post-processing is that of SAM; thresholds are those of LangSplat (Qin et al. 2024).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import cv2
import numpy as np

from gslts.semantics.masks import suppress_duplicates
from gslts.semantics.source import MAX_LEVELS
from gslts.types import Bools, Bytes, Floats32

GRID_POINTS = 32
"""Point prompts along a side of the grid, the default of SAM. Time grows with its square."""
MAX_POINTS_PER_BATCH = 8
"""Point prompts decoded at a time. Bounds memory, about 10 MB each; with 32, each takes longer."""
MIN_PREDICTED_IOU = 0.7
"""Minimum IoU of a mask with the truth, as SAM predicts it."""
MIN_STABILITY = 0.85
"""Minimum stability score of a mask: IoU of its versions at two thresholds."""
STABILITY_OFFSET = 1.0
"""Distance of these thresholds from 0, in logits; the default of SAM."""
MIN_AREA_PX = 64
"""Minimum area of a mask; CLIP cannot recognize smaller segments."""


@dataclass(frozen=True, eq=False)
class EmbeddedImage:
    """Image embedding of SAM.

    Attributes:
        values: Arrays or tensors that its decoder takes.
        size: Height and width of the image in the square that the model sees, px.
    """

    values: Any
    size: tuple[int, int]


class PromptModel(Protocol):
    """Image encoder, prompt encoder and mask decoder of a SAM."""

    side_px: int
    """Side of the square that it sees; the image lies at its upper left."""

    def embed(self, rgb: Bytes) -> EmbeddedImage:
        """Encode an image.

        Args:
            rgb: [H,W,3] uint8, sRGB.

        Returns:
            Its embedding.
        """
        ...

    def decode(self, image: EmbeddedImage, points: Floats32) -> tuple[Floats32, Floats32]:
        """Decode point prompts.

        Args:
            image: Embedding of the image.
            points: [N,2] float32, x and y in the square, px.

        Returns:
            Logits [N,3,s,s] of the masks of the square, sub-parts, parts and wholes, and the IoU
            [N,3] with the truth that the model predicts.
        """
        ...


class MaskGenerator:
    """Finds all masks of an image: 1,024 prompts, of which only good and different masks are kept.

    Args:
        model: The SAM.
    """

    def __init__(self, model: PromptModel) -> None:
        self._model = model

    def __call__(self, rgb: Bytes) -> list[Bools]:
        """Compute the masks of an image.

        Args:
            rgb: [H,W,3] uint8, sRGB.

        Returns:
            Masks [K,H,W] for each level: wholes, parts, sub-parts; the best first.

        Raises:
            ValueError: The model fails, or its scores are not finite.
        """
        full_size = rgb.shape[0], rgb.shape[1]
        image = self._model.embed(rgb)
        points = _grid(image.size)
        starts = range(0, len(points), MAX_POINTS_PER_BATCH)
        decoded = [self._decode(image, points[i : i + MAX_POINTS_PER_BATCH]) for i in starts]
        # SAM returns the smallest masks first.
        return [
            self._select([batch[level] for batch in decoded], image.size, full_size)
            for level in reversed(range(MAX_LEVELS))
        ]

    def _decode(self, image: EmbeddedImage, points: Floats32) -> list[tuple[Floats32, Floats32]]:
        """Decode point prompts; return the good masks of each level: logits [K,s,s], scores [K]."""
        logits, ious = self._model.decode(image, points)
        if not np.isfinite(ious).all():
            raise ValueError("SAM: the weights give scores that are not finite")
        stability = _stability(self._unpad(logits, image.size))
        good = (ious >= MIN_PREDICTED_IOU) & (stability >= MIN_STABILITY)
        scores = ious * stability
        return [
            (logits[good[:, level], level], scores[good[:, level], level])
            for level in range(MAX_LEVELS)
        ]

    def _select(
        self,
        decoded: list[tuple[Floats32, Floats32]],
        size: tuple[int, int],
        full_size: tuple[int, int],
    ) -> Bools:
        """Suppress duplicates among the masks of a level; return the others at full size."""
        logits, scores = (np.concatenate(parts) for parts in zip(*decoded, strict=True))
        kept = suppress_duplicates(self._unpad(logits, size) > 0, scores)
        # One at a time: as floats at full size, all together would take gigabytes.
        masks = [self._upsample(logits[row], size, full_size) for row in kept]
        masks = [mask for mask in masks if mask.sum() >= MIN_AREA_PX]
        return np.stack(masks) if masks else np.zeros((0, *full_size), np.bool_)

    def _unpad(self, logits: Floats32, size: tuple[int, int]) -> Floats32:
        """Crop logits [...,s,s] of the square to the image: [...,h,w]."""
        scale = logits.shape[-1] / self._model.side_px
        return logits[..., : round(size[0] * scale), : round(size[1] * scale)]

    def _upsample(
        self, logits: Floats32, size: tuple[int, int], full_size: tuple[int, int]
    ) -> Bools:
        square = cv2.resize(logits, (self._model.side_px, self._model.side_px))
        image = cv2.resize(square[: size[0], : size[1]], full_size[::-1])
        return np.asarray(image > 0, np.bool_)


def _grid(size: tuple[int, int]) -> Floats32:
    """Return [GRID_POINTS**2,2] x, y of the point prompts in the image, px."""
    shares = (np.arange(GRID_POINTS, dtype=np.float32) + 0.5) / GRID_POINTS
    y, x = np.meshgrid(shares * size[0], shares * size[1], indexing="ij")
    return np.stack([x.ravel(), y.ravel()], axis=1).astype(np.float32)


def _stability(logits: Floats32) -> Floats32:
    """Compute [...] the IoU of each mask [...,h,w] at a high and a low threshold."""
    inner = (logits > STABILITY_OFFSET).sum(axis=(-2, -1))
    outer = (logits > -STABILITY_OFFSET).sum(axis=(-2, -1))
    return np.asarray(inner / np.maximum(outer, 1), np.float32)
