"""`gslts.torch.rasterization` against a plain PyTorch rasterizer."""

from typing import Any

import pytest
import torch
import torch_oracle
from torch import Tensor
from torch_arguments import WIDTH, assert_same, gradients_of, make_arguments, requiring_gradients

from gslts.torch import rasterization


def render_with_oracle(
    arguments: dict[str, Any], render_mode: str = "RGB", rasterize_mode: str = "classic"
) -> tuple[Tensor, Tensor]:
    """Return the expected images and alphas of one scene whose cameras share the colours."""
    shared = dict(arguments)
    viewmats, Ks, backgrounds = (shared.pop(k, None) for k in ("viewmats", "Ks", "backgrounds"))
    images, alphas = [], []
    for i, (viewmat, K) in enumerate(zip(viewmats, Ks, strict=True)):
        color, depth, alpha = torch_oracle.render(
            **shared, viewmat=viewmat, K=K, antialiased=rasterize_mode == "antialiased"
        )
        if backgrounds is not None:
            color = color + (1 - alpha) * backgrounds[i]
        expected_depth = depth / alpha.clamp(min=1e-10)
        parts = {"RGB": [color], "D": [depth], "ED": [expected_depth]}
        images.append(torch.cat([p for mode in render_mode.split("+") for p in parts[mode]], -1))
        alphas.append(alpha)
    return torch.stack(images), torch.stack(alphas)


def tangent_part(gradient: Tensor, viewmats: Tensor) -> Tensor:
    """Project [C,4,4] gradients to the tangent space of rigid viewmats."""
    rotations = viewmats[:, :3, :3]
    product = gradient[:, :3, :3] @ rotations.mT
    result = torch.zeros_like(gradient)
    result[:, :3, :3] = 0.5 * (product - product.mT) @ rotations
    result[:, :3, 3] = gradient[:, :3, 3]
    return result


def assert_like_oracle(arguments: dict[str, Any], **options: Any) -> None:
    """Compare images and all gradients with the oracle."""
    ours, theirs = requiring_gradients(arguments), requiring_gradients(arguments)
    image, alpha, _ = rasterization(**ours, **options)
    expected = render_with_oracle(theirs, **options)
    assert expected[1].max() > 0.5
    assert_same(image, expected[0], "image")
    assert_same(alpha, expected[1], "alpha")
    actual = gradients_of(ours, image, alpha)
    wanted = gradients_of(theirs, *expected)
    wanted["viewmats"] = tangent_part(wanted["viewmats"], arguments["viewmats"])
    for name, gradient in wanted.items():
        assert_same(actual[name], gradient, name, 1e-7)


@pytest.mark.parametrize("rasterize_mode", ["classic", "antialiased"])
@pytest.mark.parametrize("channels", [1, 3, 5])
def test_plain_colors_are_those_of_the_oracle(channels, rasterize_mode):
    arguments = make_arguments(channels=channels)
    arguments["colors"][::7] = 0
    assert (arguments["colors"] < 0).any()
    assert_like_oracle(arguments, rasterize_mode=rasterize_mode)


@pytest.mark.parametrize("sh_degree", [0, 1, 2, 3])
def test_spherical_harmonics_are_those_of_the_oracle(sh_degree):
    arguments = make_arguments(channels=None, sh_degree=sh_degree)
    assert_like_oracle(arguments | {"sh_degree": sh_degree})


@pytest.mark.parametrize("bases", [5, 9, 25])
def test_spherical_harmonics_beyond_the_degree_are_not_used(bases):
    arguments = make_arguments(channels=None, sh_degree=1)
    arguments["colors"] = torch.cat([arguments["colors"], torch.ones(50, bases - 4, 3)], dim=1)
    assert_like_oracle(arguments | {"sh_degree": 1})


@pytest.mark.parametrize("channels", [3, 2])
@pytest.mark.parametrize("render_mode", ["RGB", "D", "ED", "RGB+D", "RGB+ED"])
def test_render_modes_with_backgrounds_are_those_of_the_oracle(render_mode, channels):
    arguments = make_arguments(channels=channels, cameras=2)
    arguments["backgrounds"] = torch.randn(2, channels, dtype=torch.float64)
    assert_like_oracle(arguments, render_mode=render_mode)


@pytest.mark.parametrize("options", [{"near_plane": 2.4}, {"eps2d": 1.5}, {"eps2d": 0.0}])
def test_options_are_those_of_the_oracle(options):
    assert_like_oracle(make_arguments() | options)


def test_limits_of_the_activations_are_those_of_the_oracle():
    arguments = make_arguments()
    arguments["opacities"][::3] = 0
    arguments["opacities"][1::3] = 1
    arguments["scales"][::4, 2] = 0
    arguments["scales"][1::4] *= -1
    arguments["scales"][2] = 0
    assert_like_oracle(arguments)


def test_gradient_of_the_constant_row_of_viewmats_is_zero():
    arguments = requiring_gradients(make_arguments())
    gradients = gradients_of(arguments, rasterization(**arguments)[0])
    assert gradients["viewmats"][:, :3].any()
    assert not gradients["viewmats"][:, 3].any()


def rigid(twists: Tensor, viewmats: Tensor) -> Tensor:
    """[C,4,4] exp(xi) @ viewmat for [C,6] xi = (rho, phi)."""
    rho, (x, y, z) = twists[:, :3], twists[:, 3:].T
    zero = torch.zeros_like(x)
    cross = torch.stack([zero, -z, y, z, zero, -x, -y, x, zero], dim=1).reshape(-1, 3, 3)
    generators = torch.cat([cross, rho[..., None]], dim=2)
    generators = torch.cat([generators, torch.zeros_like(generators[:, :1])], dim=1)
    return torch.matrix_exp(generators) @ viewmats


@pytest.mark.parametrize("options", [{}, {"render_mode": "RGB+ED"}, {"sh_degree": 1}])
def test_gradcheck_with_poses_that_stay_rigid(options):
    channels = None if "sh_degree" in options else 3
    arguments = make_arguments(6, seed=5, channels=channels, sh_degree=1, cameras=2)
    arguments |= {"width": 12, "height": 9}
    arguments["Ks"][:, :2] *= 12 / WIDTH
    arguments["opacities"] *= 0.9  # Off the clamp of alpha.
    viewmats = arguments.pop("viewmats")
    names = ("means", "quats", "scales", "opacities", "colors")
    inputs = [arguments.pop(name).requires_grad_() for name in names]

    def render(twists: Tensor, backgrounds: Tensor, *values: Tensor) -> tuple[Tensor, Tensor]:
        given = dict(zip(names, values, strict=True)) | arguments | options
        poses = rigid(twists, viewmats)
        image, alpha, _ = rasterization(**given, viewmats=poses, backgrounds=backgrounds)
        return image, alpha

    twists = torch.zeros(2, 6, dtype=torch.float64, requires_grad=True)
    backgrounds = torch.rand(2, 3, dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(render, (twists, backgrounds, *inputs), fast_mode=True)


def test_float32_is_like_float64():
    single, double = (
        requiring_gradients(make_arguments(400, cameras=2, dtype=dtype))
        for dtype in (torch.float32, torch.float64)
    )
    outputs = {}
    for arguments in (single, double):
        image, alpha, _ = rasterization(**arguments, render_mode="RGB+ED")
        outputs[image.dtype] = {"image": image, "alpha": alpha}
        outputs[image.dtype] |= gradients_of(arguments, image, alpha)
    for name, expected in outputs[torch.float64].items():
        actual = outputs[torch.float32][name]
        assert actual.dtype == torch.float32
        assert (actual - expected).norm() < 2e-3 * expected.norm(), name
