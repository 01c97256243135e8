"""Segment Anything (Kirillov et al. 2023): all masks of a picture, from a grid of points.

The post-processing of transformers needs torchvision, so that it is written out here. Thresholds
are those of LangSplat (Qin et al. 2024).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from numpy.typing import NDArray
from PIL import Image
from torch import Tensor
from torch.nn.functional import interpolate, pad

from gslts.semantics.masks import Masks, suppress_duplicates
from gslts.semantics.pretrained import inference_mode, load_pretrained
from gslts.semantics.source import LEVELS

EXAMPLE = "facebook/sam-vit-base"
MEAN, STD = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
"""Of ImageNet, red, green, blue, 0 to 1."""
POINTS = 32
"""On a side of the grid, as in SAM."""
AT_ONCE = 32
"""Points; each takes about 10 MB."""
LEAST_IOU = 0.7
"""Of a mask with the truth, as SAM expects it."""
LEAST_STABILITY = 0.85
STABILITY_OFFSET = 1.0
"""A stable mask is about the same with its threshold so much lower and higher."""
LEAST_PX = 64
"""Nobody could tell what smaller masks show."""


class MaskGenerator:
    """A SAM from a folder, on the CPU, where a picture takes a core minutes: it asks 1,024 points.

    Args:
        folder: As `hf download` leaves it: `config.json` and `model.safetensors`.
        threads: 0 means as many as torch takes.

    Raises:
        ImportError: transformers is missing.
        OSError: A file is missing; the message tells how to get it.
        ValueError: A file is damaged, or of another model.
    """

    def __init__(self, folder: Path, threads: int = 0) -> None:
        try:
            from transformers import SamModel
        except ImportError:
            raise ImportError(
                "SAM needs transformers and torch: pip install 'gslts[models]'"
            ) from None
        self._model = load_pretrained(SamModel, folder, EXAMPLE)
        levels = self._model.config.mask_decoder_config.num_multimask_outputs
        if levels != LEVELS:
            raise ValueError(f"{folder}: expected {LEVELS} masks a point, got {levels}")
        self._side: int = self._model.config.vision_config.image_size
        self._threads = threads

    def __call__(self, rgb: NDArray[np.uint8]) -> list[Masks]:
        """The masks of a picture.

        Args:
            rgb: [H,W,3] sRGB.

        Returns:
            [K,H,W] at each level, wholes, parts, parts of parts; the best first.
        """
        height, width = rgb.shape[:2]
        scale = self._side / max(height, width)
        size = int(height * scale + 0.5), int(width * scale + 0.5)
        with inference_mode(self._threads):
            picture = self._model.get_image_embeddings(self._whitened(rgb, size))
            points = torch.split(_grid(size), AT_ONCE)
            found = [self._of_points(picture, some, size) for some in points]
            # SAM tells the smallest first.
            return [
                self._level([one[level] for one in found], size, (height, width))
                for level in reversed(range(LEVELS))
            ]

    def _whitened(self, rgb: NDArray[np.uint8], size: tuple[int, int]) -> Tensor:
        """[1,3,S,S], the picture at the upper left, 0 elsewhere."""
        resized = Image.fromarray(rgb).resize(size[::-1], Image.Resampling.BILINEAR)
        floats = np.asarray(resized, np.float32) / 255
        whitened = (floats - np.array(MEAN, np.float32)) / np.array(STD, np.float32)
        pixels = torch.from_numpy(np.ascontiguousarray(whitened.transpose(2, 0, 1)[None]))
        return pad(pixels, (0, self._side - size[1], 0, self._side - size[0]))

    def _of_points(
        self, picture: Tensor, points: Tensor, size: tuple[int, int]
    ) -> list[tuple[Tensor, Tensor]]:
        """Good masks at each level: logits [K,s,s] and scores [K]."""
        output = self._model(image_embeddings=picture, input_points=points[None, :, None])
        logits, ious = output.pred_masks[0], output.iou_scores[0]
        stability = _stability(self._inside(logits, size))
        good = (ious >= LEAST_IOU) & (stability >= LEAST_STABILITY)
        scores = ious * stability
        return [
            (logits[good[:, level], level], scores[good[:, level], level])
            for level in range(LEVELS)
        ]

    def _level(
        self, found: list[tuple[Tensor, Tensor]], size: tuple[int, int], whole: tuple[int, int]
    ) -> Masks:
        logits, scores = (torch.cat(parts) for parts in zip(*found, strict=True))
        kept = suppress_duplicates((self._inside(logits, size) > 0).numpy(), scores.numpy())
        # One by one: at full size they would take a thousand times a picture.
        masks = [self._full(logits[row], size, whole) for row in kept]
        masks = [mask for mask in masks if mask.sum() >= LEAST_PX]
        return np.stack(masks) if masks else np.zeros((0, *whole), np.bool_)

    def _inside(self, logits: Tensor, size: tuple[int, int]) -> Tensor:
        """[...,h,w] of logits [...,s,s] of the padded square: those of the picture."""
        share = logits.shape[-1] / self._side
        return logits[..., : round(size[0] * share), : round(size[1] * share)]

    def _full(self, logits: Tensor, size: tuple[int, int], whole: tuple[int, int]) -> Masks:
        square = interpolate(logits[None, None], (self._side, self._side), mode="bilinear")
        picture = interpolate(square[..., : size[0], : size[1]], whole, mode="bilinear")
        return np.asarray((picture[0, 0] > 0).numpy(), np.bool_)


def _grid(size: tuple[int, int]) -> Tensor:
    """[POINTS**2,2] x, y in the resized picture, px."""
    shares = (torch.arange(POINTS) + 0.5) / POINTS
    y, x = torch.meshgrid(shares * size[0], shares * size[1], indexing="ij")
    return torch.stack([x.flatten(), y.flatten()], dim=1)


def _stability(logits: Tensor) -> Tensor:
    """[...] IoU of each mask [...,h,w] at a higher threshold with itself at a lower one."""
    inner = (logits > STABILITY_OFFSET).sum(dim=(-2, -1))
    outer = (logits > -STABILITY_OFFSET).sum(dim=(-2, -1))
    return inner / outer.clamp(min=1)
