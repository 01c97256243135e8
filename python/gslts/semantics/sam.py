"""Segment Anything (Kirillov et al. 2023): all masks of an image, from a grid of point prompts.

The post-processing of transformers needs torchvision; it is re-implemented here. Thresholds are
those of LangSplat (Qin et al. 2024).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from PIL import Image
from torch import Tensor
from torch.nn.functional import interpolate, pad

from gslts.semantics.masks import suppress_duplicates
from gslts.semantics.pretrained import (
    IMAGENET_MEAN,
    IMAGENET_STD,
    SAM_EXAMPLE,
    inference_mode,
    load_pretrained,
)
from gslts.semantics.source import MAX_LEVELS
from gslts.types import Bools, Bytes

GRID_POINTS = 32
"""Point prompts along a side of the grid, the default of SAM. Time grows with its square."""
MAX_POINTS_PER_BATCH = 32
"""Point prompts decoded at a time. Bounds memory: each takes about 10 MB."""
MIN_PREDICTED_IOU = 0.7
"""Minimum IoU of a mask with the truth, as SAM predicts it."""
MIN_STABILITY = 0.85
"""Minimum stability score of a mask: IoU of its versions at two thresholds."""
STABILITY_OFFSET = 1.0
"""Distance of these thresholds from 0, in logits; the default of SAM."""
MIN_AREA_PX = 64
"""Minimum area of a mask; CLIP cannot recognize smaller segments."""


class MaskGenerator:
    """SAM on the CPU, loaded from a folder. An image takes minutes on one core (1,024 prompts).

    Args:
        folder: As of `hf download`: `config.json` and `model.safetensors`.
        threads: 0 uses the default of torch.

    Raises:
        ImportError: transformers is missing.
        OSError: A file is missing; the message says how to get it.
        ValueError: A file is damaged, or belongs to another model.
    """

    def __init__(self, folder: Path, threads: int = 0) -> None:
        try:
            from transformers import SamModel
        except ImportError:
            raise ImportError(
                "SAM needs transformers and torch: pip install 'gslts[models]'"
            ) from None
        self._model = load_pretrained(SamModel, folder, SAM_EXAMPLE)
        levels = self._model.config.mask_decoder_config.num_multimask_outputs
        if levels != MAX_LEVELS:
            raise ValueError(f"{folder}: expected {MAX_LEVELS} masks per point, got {levels}")
        self._side: int = self._model.config.vision_config.image_size
        self._threads = threads

    def __call__(self, rgb: Bytes) -> list[Bools]:
        """Compute the masks of an image.

        Args:
            rgb: [H,W,3] uint8, sRGB.

        Returns:
            Masks [K,H,W] for each level: wholes, parts, sub-parts; the best first.
        """
        height, width = rgb.shape[:2]
        scale = self._side / max(height, width)
        size = int(height * scale + 0.5), int(width * scale + 0.5)
        with inference_mode(self._threads):
            embedding = self._model.get_image_embeddings(self._preprocess(rgb, size))
            batches = torch.split(_grid(size), MAX_POINTS_PER_BATCH)
            decoded = [self._decode(embedding, points, size) for points in batches]
            # SAM returns the smallest masks first.
            return [
                self._select([batch[level] for batch in decoded], size, (height, width))
                for level in reversed(range(MAX_LEVELS))
            ]

    def _preprocess(self, rgb: Bytes, size: tuple[int, int]) -> Tensor:
        """Resize, normalize and pad an image: [1,3,S,S], the image at the upper left."""
        resized = Image.fromarray(rgb).resize(size[::-1], Image.Resampling.BILINEAR)
        colors = np.asarray(resized, np.float32) / 255
        normalized = (colors - np.array(IMAGENET_MEAN, np.float32)) / np.array(
            IMAGENET_STD, np.float32
        )
        pixels = torch.from_numpy(np.ascontiguousarray(normalized.transpose(2, 0, 1)[None]))
        return pad(pixels, (0, self._side - size[1], 0, self._side - size[0]))

    def _decode(
        self, embedding: Tensor, points: Tensor, size: tuple[int, int]
    ) -> list[tuple[Tensor, Tensor]]:
        """Decode point prompts; return the good masks of each level: logits [K,s,s], scores [K]."""
        output = self._model(image_embeddings=embedding, input_points=points[None, :, None])
        logits, ious = output.pred_masks[0], output.iou_scores[0]
        stability = _stability(self._unpad(logits, size))
        good = (ious >= MIN_PREDICTED_IOU) & (stability >= MIN_STABILITY)
        scores = ious * stability
        return [
            (logits[good[:, level], level], scores[good[:, level], level])
            for level in range(MAX_LEVELS)
        ]

    def _select(
        self,
        decoded: list[tuple[Tensor, Tensor]],
        size: tuple[int, int],
        full_size: tuple[int, int],
    ) -> Bools:
        """Suppress duplicates among the masks of a level; return the others at full size."""
        logits, scores = (torch.cat(parts) for parts in zip(*decoded, strict=True))
        kept = suppress_duplicates((self._unpad(logits, size) > 0).numpy(), scores.numpy())
        # One at a time: as floats at full size, all together would take gigabytes.
        masks = [self._upsample(logits[row], size, full_size) for row in kept]
        masks = [mask for mask in masks if mask.sum() >= MIN_AREA_PX]
        return np.stack(masks) if masks else np.zeros((0, *full_size), np.bool_)

    def _unpad(self, logits: Tensor, size: tuple[int, int]) -> Tensor:
        """Crop logits [...,s,s] of the padded square to the image: [...,h,w]."""
        scale = logits.shape[-1] / self._side
        return logits[..., : round(size[0] * scale), : round(size[1] * scale)]

    def _upsample(self, logits: Tensor, size: tuple[int, int], full_size: tuple[int, int]) -> Bools:
        square = interpolate(logits[None, None], (self._side, self._side), mode="bilinear")
        image = interpolate(square[..., : size[0], : size[1]], full_size, mode="bilinear")
        return np.asarray((image[0, 0] > 0).numpy(), np.bool_)


def _grid(size: tuple[int, int]) -> Tensor:
    """Return [GRID_POINTS**2,2] x, y of the point prompts in the resized image, px."""
    shares = (torch.arange(GRID_POINTS) + 0.5) / GRID_POINTS
    y, x = torch.meshgrid(shares * size[0], shares * size[1], indexing="ij")
    return torch.stack([x.flatten(), y.flatten()], dim=1)


def _stability(logits: Tensor) -> Tensor:
    """Compute [...] the IoU of each mask [...,h,w] at a high and a low threshold."""
    inner = (logits > STABILITY_OFFSET).sum(dim=(-2, -1))
    outer = (logits > -STABILITY_OFFSET).sum(dim=(-2, -1))
    return inner / outer.clamp(min=1)
