"""Arguments of `gslts.torch.rasterization` for the scenes of `scenes`, and gradients of a loss."""

from typing import Any

import numpy as np
import scenes
import torch
from torch import Tensor

WIDTH, HEIGHT = 31, 22
DIFFERENTIABLE = ("means", "quats", "scales", "opacities", "colors", "viewmats", "backgrounds")


def make_arguments(
    size: int = 50,
    *,
    seed: int = 0,
    cameras: int = 1,
    channels: int | None = 3,
    sh_degree: int = 0,
    dtype: torch.dtype = torch.float64,
) -> dict[str, Any]:
    """Return arguments of `rasterization` for a scene of `scenes`.

    Colours are spherical harmonics if `channels` is None, else any values around 0.
    """
    gaussians = scenes.random_map(size, seed=seed, sh_degree=sh_degree, feature_dims=channels or 0)
    views = [scenes.orbit_camera(WIDTH, HEIGHT, angle_rad=0.3 + 0.5 * i) for i in range(cameras)]
    arrays = {
        "means": gaussians.means,
        "quats": gaussians.quats,
        "scales": np.exp(gaussians.log_scales),
        "opacities": 1 / (1 + np.exp(-gaussians.logit_opacities)),
        "colors": gaussians.sh if channels is None else gaussians.features,
        "viewmats": np.stack([np.linalg.inv(view.world_from_camera) for view in views]),
        "Ks": np.stack(
            [[[view.fx, 0, view.cx], [0, view.fy, view.cy], [0, 0, 1]] for view in views]
        ),
    }
    tensors = {name: torch.tensor(array, dtype=dtype) for name, array in arrays.items()}
    return tensors | {"width": WIDTH, "height": HEIGHT}


def requiring_gradients(arguments: dict[str, Any]) -> dict[str, Any]:
    """Return a copy in which each differentiable tensor is a leaf that requires a gradient."""
    return {
        name: value.detach().clone().requires_grad_() if name in DIFFERENTIABLE else value
        for name, value in arguments.items()
    }


def gradients_of(arguments: dict[str, Any], *outputs: Tensor, seed: int = 0) -> dict[str, Tensor]:
    """Return the gradients of a loss, a random linear combination of all outputs."""
    generator = torch.Generator().manual_seed(seed)
    loss = sum(
        (output * torch.randn(output.shape, generator=generator, dtype=torch.float64)).sum()
        for output in outputs
    )
    inputs = {name: arguments[name] for name in DIFFERENTIABLE if name in arguments}
    gradients = torch.autograd.grad(loss, list(inputs.values()), materialize_grads=True)
    return dict(zip(inputs, gradients, strict=True))


def assert_same(actual: Tensor, expected: Tensor, name: str, tolerance: float = 1e-9) -> None:
    assert actual.shape == expected.shape, name
    error = (actual - expected).detach().abs()
    assert (error <= tolerance * max(expected.detach().abs().max().item(), 1e-6)).all(), name
