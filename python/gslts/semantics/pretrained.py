"""Models of Hugging Face's transformers from folders of the user: whole, without running code."""

from __future__ import annotations

import json
import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import torch

CONFIG = "config.json"
WEIGHTS = "model.safetensors"
PICKLES = ("*.bin", "*.pt", "*.pth", "*.ckpt")


def load_pretrained(model_class: Any, folder: Path, example: str) -> Any:
    """A model with all its weights, float32, ready to infer.

    Args:
        model_class: Of transformers, such as CLIPModel, or AutoModel for any.
        folder: With `config.json` and `model.safetensors`; nothing is downloaded, and pickled
            weights, which can run code, are never opened.
        example: Public model that would do, such as "facebook/sam-vit-base".

    Raises:
        OSError: The folder or a file in it is missing; the message tells how to get it.
        ValueError: A file is damaged, or of another model.
    """
    _check_files(folder, model_class, example)
    _check_config(folder, getattr(model_class, "config_class", None))
    try:
        with _quiet():
            model, said = model_class.from_pretrained(
                folder,
                local_files_only=True,
                use_safetensors=True,
                trust_remote_code=False,
                ignore_mismatched_sizes=True,  # They are told below, by name.
                output_loading_info=True,
                dtype=torch.float32,
            )
    except Exception as error:  # safetensors has an exception of its own.
        reason = " ".join(str(error).split())[:300]
        raise ValueError(f"{folder}: its weights cannot be read: {reason}") from None
    # Either would be random numbers.
    if said["missing_keys"]:
        raise ValueError(f"{folder}: its weights lack {min(said['missing_keys'])}")
    if said["mismatched_keys"]:
        name, got, expected = min(said["mismatched_keys"])
        raise ValueError(
            f"{folder}: its weights do not fit its config.json: {name}: expected "
            f"{list(expected)}, got {list(got)}"
        )
    return model.eval()


@contextmanager
def inference_mode(threads: int) -> Iterator[None]:
    """No gradients, and a number of threads for torch; 0 leaves it as it is."""
    before = torch.get_num_threads()
    torch.set_num_threads(threads or before)
    try:
        with torch.inference_mode():
            yield
    finally:
        torch.set_num_threads(before)


def download_hint(folder: Path, example: str) -> str:
    """What to type where there is a network."""
    return f"download one where there is a network: hf download {example} --local-dir {folder}"


def _check_files(folder: Path, model_class: Any, example: str) -> None:
    if not folder.is_dir():
        raise FileNotFoundError(f"{folder}: no such folder; {download_hint(folder, example)}")
    if not (folder / CONFIG).is_file():
        raise FileNotFoundError(f"{folder}: there is no {CONFIG}; {download_hint(folder, example)}")
    if (folder / WEIGHTS).is_file():
        return
    pickles = sorted(path.name for pattern in PICKLES for path in folder.glob(pattern))
    if not pickles:
        raise FileNotFoundError(
            f"{folder}: there is no {WEIGHTS}; {download_hint(folder, example)}"
        )
    kind = model_class.__name__
    raise ValueError(
        f"{folder}: {pickles[0]} is pickled and could run code: it is not read; whoever trusts it "
        f"makes {WEIGHTS} of it with transformers: "
        f"{kind}.from_pretrained(FOLDER).save_pretrained(FOLDER)"
    )


def _check_config(folder: Path, config_class: Any) -> None:
    """Whether the configuration is of the kind of model, if that is known; else one only warns."""
    try:
        config = json.loads((folder / CONFIG).read_text(encoding="utf-8"))
        kind, other = config.get("model_type"), config.get("transformers_weights")
    except (ValueError, AttributeError, RecursionError):
        raise ValueError(f"{folder}: {CONFIG} is no JSON object") from None
    if config_class is not None and kind != config_class.model_type:
        raise ValueError(
            f"{folder}: expected a model of type {config_class.model_type}, got {kind}"
        )
    # transformers would read that file instead, even a pickled one.
    if other is not None:
        raise ValueError(f"{folder}: {CONFIG} names other weights, {other}; only {WEIGHTS} is read")


@contextmanager
def _quiet() -> Iterator[None]:
    """Without the tables and progress bars of transformers: errors tell what matters."""
    from transformers.utils import logging as untyped

    theirs: Any = untyped
    verbosity, bars = theirs.get_verbosity(), theirs.is_progress_bar_enabled()
    theirs.set_verbosity(logging.CRITICAL)
    theirs.disable_progress_bar()
    try:
        yield
    finally:
        theirs.set_verbosity(verbosity)
        if bars:
            theirs.enable_progress_bar()
