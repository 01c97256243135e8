"""Training of the autoencoder, with PyTorch."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from gslts.semantics.autoencoder import CODES, Autoencoder
from gslts.types import Floats32

try:
    import torch
    from torch import nn
except ImportError as error:
    raise ImportError("teaching a map needs PyTorch: pip install 'gslts[tasks]'") from error


HIDDEN = 256
"""With 128, 200 nearly orthogonal embeddings come back less than whole from 32 numbers."""
BATCH = 1024
RATE = 2e-3
ENOUGH = 2e-3
"""Loss at which embeddings come back with a cosine of about 0.999."""


def train_autoencoder(
    embeddings: Floats32, code: int = 32, steps: int = 1500, seed: int = 0
) -> Autoencoder:
    """An autoencoder for some embeddings: cosine and L2 loss, as in LangSplat (Qin et al. 2024).

    Args:
        embeddings: [S,D] of unit length, at least one; those that occur often may stand often.
        code: Length of a code.
        steps: Of Adam, at most, with all or with 1,024 embeddings drawn at random.
        seed: Of the first weights and of what is drawn.

    Raises:
        ValueError: There is no embedding, or a length is out of range.
    """
    if len(embeddings) == 0:
        raise ValueError("trained: embeddings: there is none")
    dims = embeddings.shape[1]
    if not CODES[0] <= code <= CODES[1]:
        raise ValueError(f"trained: code must be in {CODES[0]}..{CODES[1]}, got {code}")
    if dims < code:
        raise ValueError(f"trained: embeddings must have at least {code} numbers, got {dims}")
    with torch.random.fork_rng(devices=[]), _one_thread():
        torch.manual_seed(seed)
        model = nn.ModuleDict({"encoder": _layers(dims, code), "decoder": _layers(code, dims)})
        targets = torch.from_numpy(embeddings)
        optimizer = torch.optim.Adam(model.parameters(), lr=RATE)
        schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimizer, steps)
        for _ in range(steps):
            batch = targets
            if len(targets) > BATCH:
                batch = targets[torch.randint(len(targets), (BATCH,))]
            codes = nn.functional.normalize(model["encoder"](batch), dim=1)
            found = nn.functional.normalize(model["decoder"](codes), dim=1)
            cosine = 1 - (found * batch).sum(dim=1).mean()
            loss = cosine + ((found - batch) ** 2).sum(dim=1).mean()
            if float(loss.detach()) < ENOUGH:
                break
            optimizer.zero_grad()
            torch.autograd.backward(loss)
            optimizer.step()
            schedule.step()
    return Autoencoder({name: one.numpy().copy() for name, one in model.state_dict().items()})


def _layers(before: int, after: int) -> nn.Sequential:
    gelu = nn.GELU(approximate="tanh")
    return nn.Sequential(nn.Linear(before, HIDDEN), gelu, nn.Linear(HIDDEN, after))


@contextmanager
def _one_thread() -> Iterator[None]:
    """So small products are slower with several, and far slower on a busy machine."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
