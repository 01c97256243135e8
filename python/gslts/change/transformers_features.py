"""Features from a vision model of Hugging Face transformers in a local folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np

from gslts.io.onnx_file import MAX_SIDE_PX
from gslts.semantics.network_input import IMAGENET_MEAN, IMAGENET_STD
from gslts.types import Floats32


class TransformersEncoder:
    """Runs the encoder of a SAM, or a model such as DINOv2 that outputs one token per patch.

    Args:
        folder: Folder with `config.json` and `model.safetensors`; nothing is downloaded.

    Raises:
        ImportError: transformers is missing.
        OSError: The folder or a file in it cannot be read.
        ValueError: The model is no such encoder.
    """

    def __init__(self, folder: Path) -> None:
        try:
            import torch
            from transformers import AutoModel

            from gslts.semantics.pretrained import SAM_EXAMPLE, load_pretrained
        except ImportError:
            raise ImportError(
                "transformers features need transformers and torch: pip install 'gslts[models]'"
            ) from None
        self._torch = torch
        self._folder = folder
        self._model = load_pretrained(AutoModel, folder, SAM_EXAMPLE)
        self._mean = np.array(IMAGENET_MEAN, np.float32)
        self._std = np.array(IMAGENET_STD, np.float32)
        config = self._model.config
        vision = getattr(config, "vision_config", config)
        side, patch = getattr(vision, "image_size", None), getattr(vision, "patch_size", None)
        if not isinstance(side, int) or not isinstance(patch, int):
            raise ValueError(f"{folder}: its configuration lacks image_size or patch_size")
        if not 0 < patch <= side <= MAX_SIDE_PX:
            raise ValueError(
                f"{folder}: image_size must be in {patch}..{MAX_SIDE_PX} px, got {side}"
            )
        if self._model.main_input_name != "pixel_values":
            raise ValueError(f"{folder}: a {type(self._model).__name__} is no encoder of images")
        self._side, self._patches = side, side // patch

    def __call__(self, rgb: Floats32) -> Floats32:
        """Compute [h,w,D] features; see `FeatureExtractor`.

        Args:
            rgb: [H,W,3] sRGB, 0 to 1; resized to the input of the model.

        Raises:
            ValueError: The model returns fewer tokens than the image has patches.
        """
        image = cv2.resize(rgb, (self._side, self._side), interpolation=cv2.INTER_LINEAR)
        whitened = (image - self._mean) / self._std
        pixels = self._torch.from_numpy(np.ascontiguousarray(whitened.transpose(2, 0, 1)[None]))
        with self._torch.inference_mode():
            if hasattr(self._model, "get_image_embeddings"):
                features = self._model.get_image_embeddings(pixels)[0].permute(1, 2, 0)
            else:
                features = self._patch_features(
                    self._model(pixel_values=pixels).last_hidden_state[0]
                )
        return np.ascontiguousarray(features.numpy(), np.float32)

    def _patch_features(self, features: Any) -> Any:
        """Return [h,w,D] from tokens [N,D], or from the output [D,h,w] of a SAM encoder."""
        if features.ndim == 3:
            return features.permute(1, 2, 0)
        # The tokens of the patches come last, after a class token and others.
        count = self._patches**2
        if features.ndim != 2 or features.shape[0] < count:
            raise ValueError(
                f"{self._folder}: expected {count} patch tokens, got {list(features.shape)}"
            )
        tokens = features[features.shape[0] - count :]
        return tokens.reshape(self._patches, self._patches, -1)
