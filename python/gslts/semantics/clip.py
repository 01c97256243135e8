"""CLIP (Radford et al. 2021): embeds images and texts in one space."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from gslts.semantics.download import download_hint
from gslts.semantics.network_input import CLIP_MEAN, CLIP_STD, normalize
from gslts.semantics.pretrained import inference_mode, load_pretrained
from gslts.types import Bytes, Floats32

EXAMPLE = "openai/clip-vit-large-patch14"
"""Public model named in messages; it is published with safetensors."""
MAX_IMAGES_PER_BATCH = 16
"""Number of images encoded at a time; bounds memory."""


class ClipEncoder:
    """CLIP model on the CPU, loaded from a folder.

    Args:
        folder: As of `hf download`: `config.json`, `model.safetensors` and a tokenizer.
        threads: 0 uses the default of torch. The last bits of embeddings depend on the number of
            threads; results are repeatable for the same number.

    Attributes:
        dims: Length of an embedding, D.
        side_px: Side of the square images that it takes.

    Raises:
        ImportError: transformers is missing.
        OSError: A file is missing; the message says how to get it.
        ValueError: A file is damaged, or belongs to another model.
    """

    def __init__(self, folder: Path, threads: int = 0) -> None:
        try:
            from transformers import CLIPModel
        except ImportError:
            raise ImportError(
                "CLIP needs transformers and torch: pip install 'gslts[models]'"
            ) from None
        self._folder, self._threads = folder, threads
        self._model = load_pretrained(CLIPModel, folder, EXAMPLE)
        self._tokenizer = _tokenizer(folder, self._model.config.text_config)
        self.dims: int = self._model.config.projection_dim
        self.side_px: int = self._model.config.vision_config.image_size

    def encode_images(self, images: Sequence[Bytes]) -> Floats32:
        """Embed images.

        Args:
            images: S images [side_px,side_px,3] uint8, sRGB.

        Returns:
            [S,D] float32, of unit length.

        Raises:
            ValueError: An embedding is not finite.
        """
        outputs = []
        with inference_mode(self._threads):
            for start in range(0, len(images), MAX_IMAGES_PER_BATCH):
                batch = images[start : start + MAX_IMAGES_PER_BATCH]
                inputs = [normalize(image, CLIP_MEAN, CLIP_STD) for image in batch]
                pixels = torch.from_numpy(np.concatenate(inputs))
                outputs.append(self._model.get_image_features(pixel_values=pixels).pooler_output)
            return self._normalize(outputs)

    def encode_texts(self, texts: Sequence[str]) -> Floats32:
        """Embed texts; those longer than the context of the model are truncated.

        Args:
            texts: T texts.

        Returns:
            [T,D] float32, of unit length.

        Raises:
            ValueError: An embedding is not finite.
        """
        outputs = []
        longest = self._model.config.text_config.max_position_embeddings
        with inference_mode(self._threads):
            for text in texts:  # Without padding, which would couple the texts of a batch.
                tokens = self._tokenizer(
                    text, truncation=True, max_length=longest, return_tensors="pt"
                )
                output = self._model.get_text_features(input_ids=tokens.input_ids)
                outputs.append(output.pooler_output)
            return self._normalize(outputs)

    def _normalize(self, outputs: list[Tensor]) -> Floats32:
        if not outputs:
            return np.zeros((0, self.dims), np.float32)
        embeddings = torch.nn.functional.normalize(torch.cat(outputs), dim=1)
        if not embeddings.isfinite().all():
            raise ValueError(f"{self._folder}: the weights give embeddings that are not finite")
        return np.asarray(embeddings.numpy(), np.float32)


def _tokenizer(folder: Path, config: Any) -> Any:
    """Load the tokenizer; reject an empty one, which transformers makes if a file is missing."""
    from transformers import CLIPTokenizer

    tokenizers = (("tokenizer.json",), ("vocab.json", "merges.txt"))
    if not any(all((folder / name).is_file() for name in names) for names in tokenizers):
        raise FileNotFoundError(
            f"{folder}: there is no tokenizer.json and no vocab.json with merges.txt; "
            f"{download_hint(folder, EXAMPLE)}"
        )
    try:
        tokenizer = CLIPTokenizer.from_pretrained(
            folder, local_files_only=True, trust_remote_code=False
        )
        tokens = tokenizer("object").input_ids
        size = len(tokenizer)
    except Exception as error:  # The tokenizers package raises bare exceptions.
        reason = " ".join(str(error).split())[:300]
        raise ValueError(f"{folder}: the tokenizer cannot be read: {reason}") from None
    end = config.eos_token_id
    if end == 2:  # In early configurations; transformers takes the greatest token as the end.
        end = max(tokens)
    # The model takes the output at the end token: without it, all texts have one embedding.
    if size > config.vocab_size or len(tokens) < 3 or tokens[-1] != end:
        raise ValueError(f"{folder}: the tokenizer does not belong to the weights")
    return tokenizer
