"""Training of the autoencoder of embeddings, with PyTorch."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from gslts.semantics.autoencoder import MAX_CODE_DIMS, MIN_CODE_DIMS, Autoencoder
from gslts.types import Floats32

try:
    import torch
    from torch import nn
except ImportError as error:
    raise ImportError("semantics need PyTorch: pip install 'gslts[tasks]'") from error


HIDDEN = 256
"""Width of the hidden layers. With 128, 200 nearly orthogonal embeddings are not reconstructed from
32 numbers."""
MAX_BATCH = 1024
"""Maximum number of embeddings in a step; more are sampled at random. Bounds the time of a step."""
LEARNING_RATE = 2e-3
"""Initial learning rate of Adam; a cosine schedule lowers it to 0."""
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
    with torch.random.fork_rng(devices=[]), _single_thread():
        torch.manual_seed(seed)
        model = nn.ModuleDict(
            {"encoder": _layers(dims, code_dims), "decoder": _layers(code_dims, dims)}
        )
        _train(model, torch.from_numpy(embeddings), steps)
    return Autoencoder({name: array.numpy().copy() for name, array in model.state_dict().items()})


def _train(model: nn.ModuleDict, embeddings: torch.Tensor, steps: int) -> None:
    optimizer = torch.optim.Adam(model.parameters(), lr=LEARNING_RATE)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, steps)
    for _ in range(steps):
        batch = embeddings
        if len(embeddings) > MAX_BATCH:
            batch = embeddings[torch.randint(len(embeddings), (MAX_BATCH,))]
        codes = nn.functional.normalize(model["encoder"](batch), dim=1)
        decoded = nn.functional.normalize(model["decoder"](codes), dim=1)
        cosine_loss = 1 - (decoded * batch).sum(dim=1).mean()
        loss = cosine_loss + ((decoded - batch) ** 2).sum(dim=1).mean()
        if float(loss.detach()) < TARGET_LOSS:
            break
        optimizer.zero_grad()
        torch.autograd.backward(loss)
        optimizer.step()
        schedule.step()


def _layers(inputs: int, outputs: int) -> nn.Sequential:
    gelu = nn.GELU(approximate="tanh")
    return nn.Sequential(nn.Linear(inputs, HIDDEN), gelu, nn.Linear(HIDDEN, outputs))


@contextmanager
def _single_thread() -> Iterator[None]:
    """Limit torch to one thread: products this small are slower with several."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
