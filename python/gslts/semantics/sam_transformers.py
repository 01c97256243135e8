"""SAM by Hugging Face transformers, from a local folder."""

from __future__ import annotations

from pathlib import Path

import torch

from gslts.semantics.network_input import (
    IMAGENET_MEAN,
    IMAGENET_STD,
    normalize,
    pad_to_square,
    resize_longest_side,
)
from gslts.semantics.pretrained import SAM_EXAMPLE, inference_mode, load_pretrained
from gslts.semantics.sam import EmbeddedImage
from gslts.semantics.source import MAX_LEVELS
from gslts.types import Bytes, Floats32


class TransformersSam:
    """SAM on the CPU, a `PromptModel`. An image takes minutes on one core.

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
        self.side_px: int = self._model.config.vision_config.image_size
        self._threads = threads

    def embed(self, rgb: Bytes) -> EmbeddedImage:
        """Encode an image.

        Args:
            rgb: [H,W,3] uint8, sRGB.

        Returns:
            Its embedding.
        """
        resized = resize_longest_side(rgb, self.side_px)
        pixels = pad_to_square(normalize(resized, IMAGENET_MEAN, IMAGENET_STD), self.side_px)
        with inference_mode(self._threads):
            values = self._model.get_image_embeddings(torch.from_numpy(pixels))
        return EmbeddedImage(values, (resized.shape[0], resized.shape[1]))

    def decode(self, image: EmbeddedImage, points: Floats32) -> tuple[Floats32, Floats32]:
        """Decode point prompts; see `PromptModel`.

        Args:
            image: Of `embed`.
            points: [N,2] float32, x and y, px.

        Returns:
            Logits [N,3,s,s] and predicted IoU [N,3].
        """
        prompts = torch.from_numpy(points)[None, :, None]
        with inference_mode(self._threads):
            output = self._model(image_embeddings=image.values, input_points=prompts)
        return output.pred_masks[0].numpy(), output.iou_scores[0].numpy()
