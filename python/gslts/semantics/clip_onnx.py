"""CLIP, SigLIP, MobileCLIP and others as two ONNX files, in the folders of transformers.js."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np

from gslts.io.onnx_file import MAX_SIDE_PX, find_onnx, first_line, image_input, open_onnx
from gslts.semantics.download import download_hint
from gslts.semantics.network_input import CLIP_MEAN, CLIP_STD, Channels, normalize
from gslts.semantics.tokenizer import TOKENIZER, open_tokenizer
from gslts.types import Bytes, Floats32, Indices

EXAMPLE = "Xenova/mobileclip_s0"
"""Public model named in messages."""
MAX_TOKENS = 1024
"""Maximum length of a text; CLIP takes 77 tokens, SigLIP 64."""
MAX_CONFIG_BYTES = 1 << 24
"""Maximum size of a configuration file, 16 MiB."""
OUTPUTS = {"image": ("image_embeds", "pooler_output"), "text": ("text_embeds", "pooler_output")}
"""Names of the outputs that hold embeddings: of CLIP and of SigLIP."""


class OnnxClip:
    """Image and text encoders on the CPU, by onnxruntime, without PyTorch.

    Args:
        folder: With `vision_model.onnx` and `text_model.onnx`, in it or in its folder `onnx`, and
            `tokenizer.json`, `tokenizer_config.json` and `preprocessor_config.json`.
        threads: 0 leaves the choice to onnxruntime.

    Attributes:
        dims: Length of an embedding, D.
        side_px: Side of the square images that it takes.

    Raises:
        ImportError: onnxruntime or tokenizers is missing.
        OSError: A file is missing; the message says how to get it.
        ValueError: A file is damaged, or the two models do not belong together.
    """

    def __init__(self, folder: Path, threads: int = 0) -> None:
        self._images = _Encoder(folder, "vision_model*.onnx", "image", threads)
        self._texts = _Encoder(folder, "text_model*.onnx", "text", threads)
        self._input = _read_preprocessing(folder)
        self._pixels, (width, height) = image_input(
            self._images.session, self._images.path, self._input.side_px
        )
        if width != height:
            raise ValueError(f"{self._images.path}: expected square images, got {width} x {height}")
        self.side_px = width
        self._tokens = _Tokens(folder, self._texts)
        self.dims = self.encode_texts(["object"]).shape[1]

    def encode_images(self, images: Sequence[Bytes]) -> Floats32:
        """Embed images.

        Args:
            images: S images [side_px,side_px,3] uint8, sRGB.

        Returns:
            [S,D] float32, of unit length.

        Raises:
            ValueError: The model fails, or its embeddings are none of texts.
        """
        found = np.zeros((len(images), self.dims), np.float32)
        for row, image in enumerate(images):
            pixels = normalize(image, self._input.mean, self._input.std)
            embedding = self._images.run({self._pixels: pixels})
            if len(embedding) != self.dims:
                raise ValueError(
                    f"{self._images.path}: its embeddings have {len(embedding)} numbers, those of "
                    f"texts {self.dims}: export both models with their projections"
                )
            found[row] = embedding
        return found

    def encode_texts(self, texts: Sequence[str]) -> Floats32:
        """Embed texts; those longer than the context of the model are truncated.

        Args:
            texts: T texts.

        Returns:
            [T,D] float32, of unit length.

        Raises:
            ValueError: The model fails, or an embedding is not finite.
        """
        if not texts:
            return np.zeros((0, self.dims), np.float32)
        return np.stack([self._texts.run(self._tokens.feed(text)) for text in texts])


class _Encoder:
    """An ONNX model that gives an embedding."""

    def __init__(self, folder: Path, pattern: str, kind: str, threads: int) -> None:
        path = find_onnx(folder, pattern)
        if path is None:
            raise FileNotFoundError(
                f"{folder}: there is no {pattern}; {download_hint(folder, EXAMPLE)}"
            )
        self.path, self.session = path, open_onnx(path, threads)
        names = {tensor.name for tensor in self.session.get_outputs()}
        self._output = next((name for name in OUTPUTS[kind] if name in names), None)
        if self._output is None:
            expected = " or ".join(OUTPUTS[kind])
            raise ValueError(f"{path}: expected an output {expected}, got {sorted(names)}")

    def run(self, feed: dict[str, Any]) -> Floats32:
        """Return an embedding [D] of unit length."""
        try:
            found = np.asarray(self.session.run([self._output], feed)[0], np.float32)
        except Exception as error:
            raise ValueError(f"{self.path}: it does not run: {first_line(error)}") from None
        if found.ndim != 2 or len(found) != 1:
            raise ValueError(f"{self.path}: expected an embedding [1,D], got {found.shape}")
        if not np.isfinite(found).all():
            raise ValueError(f"{self.path}: the weights give embeddings that are not finite")
        return np.asarray(found[0] / max(float(np.linalg.norm(found)), 1e-12), np.float32)


class _Tokens:
    """Inputs of a text model: tokens, padded to the length on which it was trained.

    The text encoders of SigLIP and MobileCLIP attend to the padding.
    """

    def __init__(self, folder: Path, encoder: _Encoder) -> None:
        _require(folder, TOKENIZER)
        self._tokenizer = open_tokenizer(folder)
        config = _read_json(folder, "tokenizer_config.json")
        shapes = {tensor.name: tensor.shape for tensor in encoder.session.get_inputs()}
        if "input_ids" not in shapes or not shapes.keys() <= {"input_ids", "attention_mask"}:
            raise ValueError(f"{encoder.path}: expected an input input_ids, got {sorted(shapes)}")
        self._has_mask = "attention_mask" in shapes
        fixed = shapes["input_ids"][-1]
        length = fixed if isinstance(fixed, int) else config.get("model_max_length")
        if not isinstance(length, int) or not 2 < length <= MAX_TOKENS:
            raise ValueError(
                f"{folder}: tokenizer_config.json: model_max_length must be in 3..{MAX_TOKENS}, "
                f"got {length}"
            )
        pad = config.get("pad_token")
        pad = pad.get("content") if isinstance(pad, dict) else pad
        row = self._tokenizer.token_to_id(pad) if isinstance(pad, str) else None
        if row is None:
            raise ValueError(f"{folder}: tokenizer_config.json: pad_token {pad!r} is no token")
        self._tokenizer.enable_truncation(length)
        self._tokenizer.enable_padding(length=length, pad_id=row, pad_token=pad)

    def feed(self, text: str) -> dict[str, Indices]:
        """Return the inputs for a text."""
        encoded = self._tokenizer.encode(text)
        feed = {"input_ids": np.array([encoded.ids], np.int64)}
        if self._has_mask:
            feed["attention_mask"] = np.array([encoded.attention_mask], np.int64)
        return feed


@dataclass(frozen=True)
class _Preprocessing:
    """Size and normalization of images."""

    side_px: int
    mean: Channels
    std: Channels


def _read_preprocessing(folder: Path) -> _Preprocessing:
    """Read `preprocessor_config.json`, in its old and new form."""
    config = _read_json(folder, "preprocessor_config.json")
    size = config.get("crop_size") or config.get("size")
    if isinstance(size, dict):
        size = size.get("height", size.get("shortest_edge"))
    if not isinstance(size, int) or not 0 < size <= MAX_SIDE_PX:
        raise ValueError(
            f"{folder}: preprocessor_config.json: the size must be in 1..{MAX_SIDE_PX} px, "
            f"got {size}"
        )
    if config.get("do_normalize", True) is False:
        return _Preprocessing(size, (0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    mean, std = config.get("image_mean", CLIP_MEAN), config.get("image_std", CLIP_STD)
    if not (_is_channels(mean) and _is_channels(std) and min(std) > 0):
        raise ValueError(
            f"{folder}: preprocessor_config.json: image_mean and image_std must be three numbers, "
            f"got {mean} and {std}"
        )
    return _Preprocessing(size, tuple(mean), tuple(std))


def _is_channels(value: Any) -> bool:
    return (
        isinstance(value, (list, tuple))
        and len(value) == 3
        and all(isinstance(number, (int, float)) and isfinite(number) for number in value)
    )


def _read_json(folder: Path, name: str) -> dict[str, Any]:
    path = _require(folder, name)
    if path.stat().st_size > MAX_CONFIG_BYTES:
        raise ValueError(f"{path}: it is larger than {MAX_CONFIG_BYTES >> 20} MiB")
    try:
        config = json.loads(path.read_text(encoding="utf-8"))
    except (ValueError, RecursionError):
        config = None
    if not isinstance(config, dict):
        raise ValueError(f"{path}: it is no JSON object")
    return config


def _require(folder: Path, name: str) -> Path:
    if not (folder / name).is_file():
        raise FileNotFoundError(f"{folder}: there is no {name}; {download_hint(folder, EXAMPLE)}")
    return folder / name
