"""Embeddings in few numbers: the autoencoder of GS-LTS, sec. III-B.

Gaussians keep d numbers each instead of D; the decoder brings them back to the space of the words.
What a robot needs to ask its map is here, in numpy; `train_autoencoder` needs PyTorch.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from math import pi, sqrt
from pathlib import Path

import numpy as np
from safetensors import SafetensorError
from safetensors.numpy import load, save

from gslts.types import Floats32

MOST_BYTES = 1 << 26
REPAIR = "gslts semantics teaches the map anew"
CODES = (8, 64)
"""Least and greatest length of a code."""


@dataclass(frozen=True, eq=False)
class Autoencoder:
    """Two layers that compress embeddings of unit length, and two that bring them back.

    Args:
        weights: Of the layers [out,in] and their biases [out], by the names that PyTorch gives
            them: `encoder.0.weight`, `encoder.0.bias`, `encoder.2.weight` and so on, float32.

    Raises:
        ValueError: One is missing or has another shape or dtype, is not finite, or the code has no
            length of `CODES`.
    """

    weights: Mapping[str, Floats32]

    def __post_init__(self) -> None:
        names = [f"{part}.{layer}" for part in ("encoder", "decoder") for layer in (0, 2)]
        expected = {f"{name}.{kind}" for name in names for kind in ("weight", "bias")}
        if set(self.weights) != expected:
            unlike = ", ".join(sorted(expected ^ set(self.weights)))
            raise ValueError(f"Autoencoder: weights: missing or unknown: {unlike}")
        for name, one in self.weights.items():
            if one.dtype != np.float32 or one.ndim != (2 if name.endswith("weight") else 1):
                raise ValueError(f"Autoencoder: {name}: got {one.dtype} {one.shape}")
            if not np.isfinite(one).all():
                raise ValueError(f"Autoencoder: {name}: a number is not finite")
        hidden, dims = self.weights["encoder.0.weight"].shape
        code = len(self.weights["encoder.2.weight"])
        sides = ((hidden, dims), (code, hidden), (hidden, code), (dims, hidden))
        for name, shape in zip(names, sides, strict=True):
            got = self.weights[f"{name}.weight"].shape, self.weights[f"{name}.bias"].shape
            if got != (shape, shape[:1]):
                raise ValueError(
                    f"Autoencoder: {name}: expected {shape}, got {got[0]} and {got[1]}"
                )
        if not CODES[0] <= code <= CODES[1] or dims < code:
            raise ValueError(f"Autoencoder: a code of {code} numbers for embeddings of {dims}")

    @property
    def dims(self) -> int:
        """Length of an embedding, D."""
        return int(self.weights["encoder.0.weight"].shape[1])

    @property
    def code(self) -> int:
        """Length of a code, d."""
        return len(self.weights["encoder.2.weight"])

    def encode(self, embeddings: Floats32) -> Floats32:
        """[S,d] codes of unit length of embeddings [S,D]."""
        return self._through("encoder", embeddings)

    def decode(self, codes: Floats32) -> Floats32:
        """[S,D] embeddings of unit length of codes [S,d], also of mixtures of codes."""
        return self._through("decoder", codes)

    def cosines(self, codes: Floats32, vectors: Floats32) -> Floats32:
        """[S,V] of decoded codes [S,d] and vectors [V,D] of unit length.

        The same as `decoded(codes) @ vectors.T`, without embeddings: their lengths and products
        follow from the hidden layer.
        """
        hidden, weight, bias = self._hidden("decoder", codes), *self._last("decoder")
        products = hidden @ (weight.T @ vectors.T) + vectors @ bias
        squares = ((hidden @ (weight.T @ weight) + 2 * (bias @ weight)) * hidden).sum(axis=1)
        lengths = np.sqrt(np.maximum(squares + bias @ bias, 1e-24))
        return np.asarray(products / lengths[:, None], np.float32)

    def _through(self, part: str, vectors: Floats32) -> Floats32:
        weight, bias = self._last(part)
        found = self._hidden(part, vectors) @ weight.T + bias
        lengths = np.linalg.norm(found, axis=1, keepdims=True)
        return np.asarray(found / np.maximum(lengths, 1e-12), np.float32)

    def _hidden(self, part: str, vectors: Floats32) -> Floats32:
        weight, bias = self.weights[f"{part}.0.weight"], self.weights[f"{part}.0.bias"]
        return _gelu(vectors @ weight.T + bias)

    def _last(self, part: str) -> tuple[Floats32, Floats32]:
        return self.weights[f"{part}.2.weight"], self.weights[f"{part}.2.bias"]


def _gelu(x: Floats32) -> Floats32:
    """GELU with the hyperbolic tangent (Hendrycks & Gimpel 2016)."""
    inner = np.float32(sqrt(2 / pi)) * (x + np.float32(0.044715) * x * x * x)
    return np.asarray(np.float32(0.5) * x * (1 + np.tanh(inner)), np.float32)


def autoencoder_bytes(model: Autoencoder) -> bytes:
    """As safetensors."""
    return save(dict(model.weights))


def read_autoencoder(path: Path, digest: str) -> Autoencoder:
    """Reads what `autoencoder_bytes` gave.

    Args:
        path: Of the file.
        digest: SHA-256 of its content, in hexadecimal digits.

    Raises:
        OSError: The file cannot be read.
        ValueError: It is damaged, or no autoencoder.
    """
    try:
        with path.open("rb") as file:
            content = file.read(MOST_BYTES + 1)
    except FileNotFoundError:
        raise FileNotFoundError(f"{path}: it is missing; {REPAIR}") from None
    if len(content) > MOST_BYTES:
        raise ValueError(f"{path}: larger than {MOST_BYTES >> 20} MiB")
    if hashlib.sha256(content).hexdigest() != digest:
        raise ValueError(f"{path}: it is damaged; {REPAIR}")
    try:
        return Autoencoder(load(content))
    except (SafetensorError, ValueError) as error:
        raise ValueError(f"{path}: it is no autoencoder: {error}") from None
