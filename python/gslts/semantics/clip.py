"""CLIP (Radford et al. 2021): pictures and words as embeddings in one space."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from gslts.semantics.pretrained import download_hint, inference_mode, load_pretrained
from gslts.types import Floats32

Image = NDArray[np.uint8]

EXAMPLE = "openai/clip-vit-large-patch14"
"""Published with safetensors."""
MEAN, STD = (0.48145466, 0.4578275, 0.40821073), (0.26862954, 0.26130258, 0.27577711)
"""Of the pictures that CLIP was trained with, red, green, blue, 0 to 1."""
AT_ONCE = 16
TOKENIZERS = (("tokenizer.json",), ("vocab.json", "merges.txt"))
"""Files, either of which suffice."""
LEGACY_END = 2
"""`eos_token_id` in early configurations, where transformers looks for the greatest token."""


class ClipEncoder:
    """A CLIP from a folder, on the CPU.

    Args:
        folder: As `hf download` leaves it: `config.json`, `model.safetensors` and a tokenizer.
        threads: 0 means as many as torch takes. Another number may change the last bits of
            embeddings; the same one gives the same bits.

    Attributes:
        dims: Length of an embedding, D.
        side_px: Of the square pictures that it takes.

    Raises:
        ImportError: transformers is missing.
        OSError: A file is missing; the message tells how to get it.
        ValueError: A file is damaged, or of another model.
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

    def encode_images(self, pictures: Sequence[Image]) -> Floats32:
        """[S,D] embeddings, of unit length, of pictures [side_px,side_px,3] uint8, sRGB.

        Raises:
            ValueError: An embedding is not finite.
        """
        found = []
        with inference_mode(self._threads):
            for start in range(0, len(pictures), AT_ONCE):
                stacked = np.stack(pictures[start : start + AT_ONCE]).astype(np.float32) / 255
                whitened = (stacked - np.array(MEAN, np.float32)) / np.array(STD, np.float32)
                pixels = torch.from_numpy(np.ascontiguousarray(whitened.transpose(0, 3, 1, 2)))
                found.append(self._model.get_image_features(pixel_values=pixels).pooler_output)
            return self._unit(found)

    def encode_texts(self, texts: Sequence[str]) -> Floats32:
        """[T,D] embeddings, of unit length; of long texts only the beginning counts.

        Raises:
            ValueError: An embedding is not finite.
        """
        found = []
        longest = self._model.config.text_config.max_position_embeddings
        with inference_mode(self._threads):
            for text in texts:  # One by one, so that no text depends on the others.
                tokens = self._tokenizer(
                    text, truncation=True, max_length=longest, return_tensors="pt"
                )
                output = self._model.get_text_features(input_ids=tokens.input_ids)
                found.append(output.pooler_output)
            return self._unit(found)

    def _unit(self, found: list[Tensor]) -> Floats32:
        if not found:
            return np.zeros((0, self.dims), np.float32)
        embeddings = torch.nn.functional.normalize(torch.cat(found), dim=1)
        if not embeddings.isfinite().all():
            raise ValueError(f"{self._folder}: its weights give numbers that are not finite")
        return np.asarray(embeddings.numpy(), np.float32)


def _tokenizer(folder: Path, config: Any) -> Any:
    """That of the folder; one without words, as transformers makes of nothing, is refused."""
    from transformers import CLIPTokenizer

    if not any(all((folder / name).is_file() for name in names) for names in TOKENIZERS):
        raise FileNotFoundError(
            f"{folder}: there is no tokenizer.json, nor vocab.json with merges.txt; "
            f"{download_hint(folder, EXAMPLE)}"
        )
    try:
        tokenizer = CLIPTokenizer.from_pretrained(
            folder, local_files_only=True, trust_remote_code=False
        )
        tokens = tokenizer("object").input_ids
        size = len(tokenizer)
    except Exception as error:  # The Rust of tokenizers raises bare exceptions.
        reason = " ".join(str(error).split())[:300]
        raise ValueError(f"{folder}: its tokenizer cannot be read: {reason}") from None
    end = config.eos_token_id
    if end == LEGACY_END:
        end = max(tokens)
    # The model reads a text at its end: without one, all texts would be the same.
    if size > config.vocab_size or len(tokens) < 3 or tokens[-1] != end:
        raise ValueError(f"{folder}: its tokenizer is not that of its weights")
    return tokenizer
