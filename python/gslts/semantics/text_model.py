"""Sentence embeddings from an ONNX file and its tokenizer, such as those of MiniLM."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from gslts.io.onnx_file import first_line, open_onnx
from gslts.semantics.tokenizer import TOKENIZER, open_tokenizer
from gslts.types import Floats32

MODELS = ("model.onnx", "onnx/model.onnx")
"""Files of the model, as sentence-transformers and optimum write it."""
MAX_TOKENS = 64
"""Maximum length of a text; names are short."""
INPUTS = ("input_ids", "attention_mask", "token_type_ids")
"""Inputs that are known."""


class TextModel:
    """Embeds texts, with one thread.

    Args:
        folder: With `model.onnx` or `onnx/model.onnx`, and `tokenizer.json`.

    Raises:
        ImportError: onnxruntime or tokenizers is missing.
        OSError: A file is missing.
        ValueError: A file is damaged, or the model is none of sentence embeddings.
    """

    def __init__(self, folder: Path) -> None:
        path = next((folder / name for name in MODELS if (folder / name).is_file()), None)
        if path is None or not (folder / TOKENIZER).is_file():
            raise FileNotFoundError(
                f"{folder}: expected {MODELS[0]} and {TOKENIZER}, as sentence-transformers exports"
            )
        self._path, self._session = path, open_onnx(path)
        self._inputs = [tensor.name for tensor in self._session.get_inputs()]
        if not set(self._inputs) <= set(INPUTS):
            raise ValueError(f"{path}: expected inputs {', '.join(INPUTS)}, got {self._inputs}")
        self._tokenizer = open_tokenizer(folder)
        self._tokenizer.no_padding()
        self._tokenizer.enable_truncation(MAX_TOKENS)

    def encode(self, texts: Sequence[str]) -> Floats32:
        """Embed texts: the mean of the embeddings of their tokens.

        Args:
            texts: Words or sentences.

        Returns:
            [T,D] float32, of unit length.

        Raises:
            ValueError: The model fails, or gives no embedding.
        """
        return np.array([self._embed(text) for text in texts], np.float32)

    def _embed(self, text: str) -> Floats32:
        tokens = np.array([self._tokenizer.encode(text).ids], np.int64)
        values = {"input_ids": tokens, "attention_mask": np.ones_like(tokens)}
        feed = {name: values.get(name, np.zeros_like(tokens)) for name in self._inputs}
        try:
            output = np.asarray(self._session.run(None, feed)[0], np.float32)
        except Exception as error:
            raise ValueError(f"{self._path}: it takes no text: {first_line(error)}") from None
        if output.shape[0] != 1 or output.ndim not in (2, 3) or not np.isfinite(output).all():
            raise ValueError(f"{self._path}: expected embeddings [1,T,D], got {output.shape}")
        vector = output[0].mean(axis=0) if output.ndim == 3 else output[0]
        return np.asarray(vector / max(float(np.linalg.norm(vector)), 1e-12), np.float32)
