"""Training of the autoencoder of embeddings."""

from __future__ import annotations

from math import cos, pi, sqrt

import numpy as np

from gslts.semantics.autoencoder import (
    MAX_CODE_DIMS,
    MIN_CODE_DIMS,
    Autoencoder,
    gelu,
    gelu_slope,
)
from gslts.types import Floats32

HIDDEN = 256
"""Width of the hidden layers. With 128, 200 nearly orthogonal embeddings are not reconstructed from
32 numbers."""
MAX_BATCH = 1024
"""Maximum number of embeddings in a step; more are sampled at random. Bounds the time of a step."""
LEARNING_RATE = 2e-3
"""Initial learning rate of Adam; a cosine schedule lowers it to 0."""
BETAS, EPSILON = (0.9, 0.999), np.float32(1e-8)
"""Constants of Adam (Kingma & Ba 2015)."""
TARGET_LOSS = 2e-3
"""Loss at which training stops early: reconstructions have a cosine of about 0.999 with their
embeddings."""


def train_autoencoder(
    embeddings: Floats32, code_dims: int = 32, steps: int = 1500, seed: int = 0
) -> Autoencoder:
    """Train an autoencoder with the cosine and L2 losses of LangSplat (Qin et al. 2024).

    Args:
        embeddings: [S,D] float32, of unit length, at least one. Repeat rows to weight them.
        code_dims: Length of a code, d.
        steps: Maximum number of steps of Adam.
        seed: For the initial weights and the batches.

    Returns:
        The autoencoder; the same for the same arguments.

    Raises:
        ValueError: There is no embedding, or a length is out of range.
    """
    if len(embeddings) == 0:
        raise ValueError("train_autoencoder: embeddings: expected at least one, got none")
    dims = embeddings.shape[1]
    if not MIN_CODE_DIMS <= code_dims <= MAX_CODE_DIMS:
        raise ValueError(
            f"train_autoencoder: code_dims must be in {MIN_CODE_DIMS}..{MAX_CODE_DIMS}, "
            f"got {code_dims}"
        )
    if dims < code_dims:
        raise ValueError(
            f"train_autoencoder: embeddings must have at least {code_dims} dimensions, got {dims}"
        )
    rng = np.random.default_rng(seed)
    weights: dict[str, Floats32] = {}
    for part, widths in (
        ("encoder", (dims, HIDDEN, code_dims)),
        ("decoder", (code_dims, HIDDEN, dims)),
    ):
        for layer, inputs, outputs in (0, *widths[:2]), (2, *widths[1:]):
            bound = 1 / sqrt(inputs)  # As PyTorch initializes a linear layer.
            for kind, shape in ("weight", (outputs, inputs)), ("bias", (outputs,)):
                array = rng.uniform(-bound, bound, shape).astype(np.float32)
                weights[f"{part}.{layer}.{kind}"] = array
    _train(weights, embeddings, steps, rng)
    return Autoencoder(weights)


def _train(
    weights: dict[str, Floats32], embeddings: Floats32, steps: int, rng: np.random.Generator
) -> None:
    """Minimize the loss by Adam (Kingma & Ba 2015) in place."""
    means = {name: np.zeros_like(array) for name, array in weights.items()}
    squares = {name: np.zeros_like(array) for name, array in weights.items()}
    for step in range(1, steps + 1):
        batch = embeddings
        if len(embeddings) > MAX_BATCH:
            batch = embeddings[rng.integers(len(embeddings), size=MAX_BATCH)]
        loss, gradients = loss_and_gradients(weights, batch)
        if loss < TARGET_LOSS:
            break
        rate = LEARNING_RATE * (1 + cos(pi * (step - 1) / steps)) / 2
        for name, gradient in gradients.items():
            means[name] += (1 - BETAS[0]) * (gradient - means[name])
            squares[name] += (1 - BETAS[1]) * (gradient * gradient - squares[name])
            mean = means[name] / np.float32(1 - BETAS[0] ** step)
            size = np.sqrt(squares[name] / np.float32(1 - BETAS[1] ** step)) + EPSILON
            weights[name] -= np.float32(rate) * mean / size


def loss_and_gradients(
    weights: dict[str, Floats32], batch: Floats32
) -> tuple[float, dict[str, Floats32]]:
    """Compute the loss of a batch and its derivatives by the weights, by the chain rule.

    Args:
        weights: float32, those of an `Autoencoder`.
        batch: [B,D] float32, of unit length.

    Returns:
        The loss, and for each array of the weights its derivatives.
    """
    codes, encoded = _forward(weights, "encoder", batch)
    decoded, reconstructed = _forward(weights, "decoder", codes)
    # The cosine loss and the L2 loss, which is twice the former, as vectors have unit length.
    loss = float(3 * (1 - (decoded * batch).sum(axis=1)).mean())
    dL_ddecoded = batch * np.float32(-3 / len(batch))
    gradients: dict[str, Floats32] = {}
    dL_dcodes = _backward(weights, "decoder", codes, reconstructed, dL_ddecoded, gradients)
    _backward(weights, "encoder", batch, encoded, dL_dcodes, gradients)
    return loss, gradients


def _forward(
    weights: dict[str, Floats32], part: str, inputs: Floats32
) -> tuple[Floats32, tuple[Floats32, ...]]:
    """Apply two layers and a normalization; return the result, and values before each step."""
    before = inputs @ weights[f"{part}.0.weight"].T + weights[f"{part}.0.bias"]
    hidden = gelu(before)
    result = hidden @ weights[f"{part}.2.weight"].T + weights[f"{part}.2.bias"]
    lengths = np.maximum(np.linalg.norm(result, axis=1, keepdims=True), np.float32(1e-12))
    outputs = result / lengths
    return outputs, (before, hidden, lengths, outputs)


def _backward(
    weights: dict[str, Floats32],
    part: str,
    inputs: Floats32,
    values: tuple[Floats32, ...],
    dL_doutputs: Floats32,
    gradients: dict[str, Floats32],
) -> Floats32:
    """Add the derivatives by the weights of a part to `gradients`; return those by its inputs."""
    before, hidden, lengths, outputs = values
    along = (dL_doutputs * outputs).sum(axis=1, keepdims=True)
    dL_dresult = (dL_doutputs - along * outputs) / lengths
    gradients[f"{part}.2.weight"] = dL_dresult.T @ hidden
    gradients[f"{part}.2.bias"] = dL_dresult.sum(axis=0)
    dL_dbefore = (dL_dresult @ weights[f"{part}.2.weight"]) * gelu_slope(before)
    gradients[f"{part}.0.weight"] = dL_dbefore.T @ inputs
    gradients[f"{part}.0.bias"] = dL_dbefore.sum(axis=0)
    dL_dinputs: Floats32 = dL_dbefore @ weights[f"{part}.0.weight"]
    return dL_dinputs
