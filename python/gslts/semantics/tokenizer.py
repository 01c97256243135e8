"""Tokenizers of text models, in the format of Hugging Face tokenizers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gslts.io.onnx_file import first_line

TOKENIZER, MAX_TOKENIZER_BYTES = "tokenizer.json", 1 << 26
"""File of the tokenizer, and its maximum size, 64 MiB."""


def open_tokenizer(folder: Path) -> Any:
    """Open `tokenizer.json`.

    Args:
        folder: With this file.

    Returns:
        The `Tokenizer`.

    Raises:
        ImportError: The package tokenizers is missing.
        OSError: The file is missing.
        ValueError: The file is too large, or is no tokenizer.
    """
    try:
        from tokenizers import Tokenizer
    except ImportError:
        raise ImportError("text models need tokenizers: pip install 'gslts[words]'") from None
    path = folder / TOKENIZER
    if path.stat().st_size > MAX_TOKENIZER_BYTES:
        raise ValueError(f"{path}: it is larger than {MAX_TOKENIZER_BYTES >> 20} MiB")
    try:
        return Tokenizer.from_file(str(path))
    except Exception as error:  # tokenizers raises a plain Exception.
        raise ValueError(f"{path}: it is no tokenizer: {first_line(error)}") from None
