"""Loads models of Hugging Face transformers from local folders, without running code from them."""

from __future__ import annotations

import json
import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import torch

from gslts.semantics.download import download_hint, require_folder

CONFIG, WEIGHTS = "config.json", "model.safetensors"
"""File names of transformers."""
SAM_EXAMPLE = "facebook/sam-vit-base"
"""Public SAM named in messages."""


def load_pretrained(model_class: Any, folder: Path, example: str) -> Any:
    """Load a model with all its weights, float32, in evaluation mode.

    Args:
        model_class: Class of transformers, such as CLIPModel, or AutoModel for any.
        folder: With `config.json` and `model.safetensors`; nothing is downloaded, and pickled
            weights, which can run code, are never opened.
        example: Name of a public model to suggest in messages, such as "facebook/sam-vit-base".

    Returns:
        The model.

    Raises:
        OSError: The folder or a file in it is missing; the message says how to get it.
        ValueError: A file is damaged, or belongs to another model.
    """
    _check_files(folder, model_class, example)
    _check_config(folder, getattr(model_class, "config_class", None))
    try:
        with _quiet():
            model, info = model_class.from_pretrained(
                folder,
                local_files_only=True,
                use_safetensors=True,
                trust_remote_code=False,
                ignore_mismatched_sizes=True,  # Reported below, by name.
                output_loading_info=True,
                dtype=torch.float32,
            )
    except Exception as error:  # safetensors raises an exception class of its own.
        reason = " ".join(str(error).split())[:300]
        raise ValueError(f"{folder}: its weights cannot be read: {reason}") from None
    # transformers would initialize either at random.
    if info["missing_keys"]:
        raise ValueError(f"{folder}: its weights lack {min(info['missing_keys'])}")
    if info["mismatched_keys"]:
        name, got, expected = min(info["mismatched_keys"])
        raise ValueError(
            f"{folder}: its weights do not fit its config.json: {name}: expected "
            f"{list(expected)}, got {list(got)}"
        )
    return model.eval()


@contextmanager
def inference_mode(threads: int) -> Iterator[None]:
    """Run torch without gradients, and with a number of threads.

    Args:
        threads: Restored at the end; 0 leaves the number as it is.

    Yields:
        Nothing.
    """
    before = torch.get_num_threads()
    torch.set_num_threads(threads or before)
    try:
        with torch.inference_mode():
            yield
    finally:
        torch.set_num_threads(before)


def _check_files(folder: Path, model_class: Any, example: str) -> None:
    require_folder(folder, example)
    if not (folder / CONFIG).is_file():
        raise FileNotFoundError(f"{folder}: there is no {CONFIG}; {download_hint(folder, example)}")
    if (folder / WEIGHTS).is_file():
        return
    patterns = ("*.bin", "*.pt", "*.pth", "*.ckpt")  # Named in a message, never opened.
    pickles = sorted(path.name for pattern in patterns for path in folder.glob(pattern))
    if not pickles:
        raise FileNotFoundError(
            f"{folder}: there is no {WEIGHTS}; {download_hint(folder, example)}"
        )
    kind = model_class.__name__
    raise ValueError(
        f"{folder}: {pickles[0]} is pickled and could run code: it is not read; if you trust it, "
        f"convert it to {WEIGHTS} with transformers: "
        f"{kind}.from_pretrained(FOLDER).save_pretrained(FOLDER)"
    )


def _check_config(folder: Path, config_class: Any) -> None:
    """Check the model type, as transformers only warns, and reject a redirection of weights."""
    try:
        config = json.loads((folder / CONFIG).read_text(encoding="utf-8"))
        model_type, other = config.get("model_type"), config.get("transformers_weights")
    except (ValueError, AttributeError, RecursionError):
        raise ValueError(f"{folder}: {CONFIG} is no JSON object") from None
    if config_class is not None and model_type != config_class.model_type:
        raise ValueError(
            f"{folder}: expected a model of type {config_class.model_type}, got {model_type}"
        )
    # transformers would read the other file, even a pickled one.
    if other is not None:
        raise ValueError(f"{folder}: {CONFIG} names other weights, {other}; only {WEIGHTS} is read")


@contextmanager
def _quiet() -> Iterator[None]:
    """Suppress the log and the progress bars of transformers; errors are reported by exceptions."""
    from transformers.utils import logging as untyped_logging

    log: Any = untyped_logging
    verbosity, bars = log.get_verbosity(), log.is_progress_bar_enabled()
    log.set_verbosity(logging.CRITICAL)
    log.disable_progress_bar()
    try:
        yield
    finally:
        log.set_verbosity(verbosity)
        if bars:
            log.enable_progress_bar()
