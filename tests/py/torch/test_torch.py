"""`gslts.torch.rasterization` against a plain PyTorch rasterizer, and its behaviour in autograd."""

import enum
import inspect
import sys
from typing import Any

import numpy as np
import pytest
import scenes
import torch
import torch_oracle
from torch import Tensor

from gslts.torch import rasterization

WIDTH, HEIGHT = 31, 22
DIFFERENTIABLE = ("means", "quats", "scales", "opacities", "colors", "viewmats", "backgrounds")

# fmt: off
GSPLAT_PARAMETERS = [
    "means", "quats", "scales", "opacities", "colors", "viewmats", "Ks", "width", "height",
    "near_plane", "far_plane", "radius_clip", "eps2d", "sh_degree", "packed", "tile_size",
    "backgrounds", "render_mode", "sparse_grad", "absgrad", "rasterize_mode", "channel_chunk",
    "distributed", "camera_model", "segmented", "covars", "with_ut", "with_eval3d", "radial_coeffs",
    "tangential_coeffs", "thin_prism_coeffs", "ftheta_coeffs", "rolling_shutter", "viewmats_rs",
]
# fmt: on


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


def assert_same(actual: Tensor, expected: Tensor, name: str, tolerance: float = 1e-9) -> None:
    assert actual.shape == expected.shape, name
    error = (actual - expected).detach().abs()
    assert (error <= tolerance * max(expected.detach().abs().max().item(), 1e-6)).all(), name


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


def test_a_batch_equals_its_scenes():
    scenes_ = [make_arguments(seed=seed, cameras=3) for seed in range(4)]
    for scene, seed in zip(scenes_, range(4), strict=True):
        scene["backgrounds"] = torch.full((3, 3), 0.1 * seed, dtype=torch.float64)
    tensors = [name for name, value in scenes_[0].items() if isinstance(value, Tensor)]
    stacked = {name: torch.stack([scene[name] for scene in scenes_]) for name in tensors}
    batch = scenes_[0] | {name: t.reshape(2, 2, *t.shape[1:]) for name, t in stacked.items()}
    batch = requiring_gradients(batch)
    image, alpha, meta = rasterization(**batch)
    assert image.shape == (2, 2, 3, HEIGHT, WIDTH, 3)
    assert alpha.shape == (2, 2, 3, HEIGHT, WIDTH, 1)
    assert meta == {"width": WIDTH, "height": HEIGHT, "n_cameras": 3, "n_batches": 4}
    image.square().sum().backward()
    for i, scene in enumerate(scenes_):
        part = requiring_gradients(scene)
        part_image, _, _ = rasterization(**part)
        assert torch.equal(image[i // 2, i % 2], part_image)
        part_image.square().sum().backward()
        for name in DIFFERENTIABLE:
            assert torch.equal(batch[name].grad[i // 2, i % 2], part[name].grad), name


@pytest.mark.parametrize("sh_degree", [None, 1])
def test_colors_by_camera(sh_degree):
    channels = 3 if sh_degree is None else None
    arguments = make_arguments(cameras=2, channels=channels, sh_degree=1)
    arguments |= {"sh_degree": sh_degree}
    colors = torch.stack([arguments["colors"], arguments["colors"].flip(0)]).requires_grad_()
    image, _, _ = rasterization(**arguments | {"colors": colors})
    image.sum().backward()
    for i in range(2):
        color = colors.detach()[i].requires_grad_()
        alone = rasterization(**arguments | {"colors": color})[0][i]
        assert torch.equal(image[i], alone)
        alone.sum().backward()
        assert torch.equal(colors.grad[i], color.grad)


def test_two_forwards_before_a_backward():
    arguments = requiring_gradients(make_arguments(cameras=2))
    views = [
        arguments | {name: arguments[name][i : i + 1] for name in ("viewmats", "Ks")}
        for i in range(2)
    ]
    apart = [gradients_of(arguments, rasterization(**view)[0]) for view in views]
    images = [rasterization(**view)[0] for view in views]
    generator = torch.Generator().manual_seed(0)
    weights = torch.randn(images[0].shape, generator=generator, dtype=torch.float64)
    (weights * images[0] + weights * images[1]).sum().backward()
    for name in ("means", "quats", "scales", "opacities", "colors", "viewmats"):
        assert_same(arguments[name].grad, apart[0][name] + apart[1][name], name, 1e-12)


@pytest.mark.parametrize("wanted", DIFFERENTIABLE)
def test_only_requested_gradients_are_computed(wanted):
    arguments = make_arguments() | {"backgrounds": torch.ones(1, 3, dtype=torch.float64)}
    assert not rasterization(**arguments)[0].requires_grad
    everything = requiring_gradients(arguments)
    expected = gradients_of(everything, rasterization(**everything)[0])[wanted]
    arguments[wanted].requires_grad_()
    image, _, _ = rasterization(**arguments)
    generator = torch.Generator().manual_seed(0)
    image.backward(torch.randn(image.shape, generator=generator, dtype=torch.float64))
    assert torch.equal(arguments[wanted].grad, expected)
    assert all(arguments[name].grad is None for name in DIFFERENTIABLE if name != wanted)


def test_depth_has_no_gradient_of_colors():
    arguments = requiring_gradients(make_arguments())
    rasterization(**arguments, render_mode="ED")[0].sum().backward()
    assert arguments["colors"].grad is None
    assert arguments["means"].grad.any()


def test_a_second_backward_is_rejected():
    arguments = requiring_gradients(make_arguments())
    loss = rasterization(**arguments)[0].sum()
    loss.backward(retain_graph=True)
    once = arguments["means"].grad.clone()
    loss.backward()
    assert torch.equal(arguments["means"].grad, 2 * once)
    with pytest.raises(RuntimeError, match="second time"):
        loss.backward()


def test_second_derivative_is_rejected():
    arguments = requiring_gradients(make_arguments())
    loss = rasterization(**arguments)[0].square().sum()
    (gradient,) = torch.autograd.grad(loss, arguments["means"], create_graph=True)
    with pytest.raises(RuntimeError, match="once_differentiable"):
        gradient.sum().backward()


def test_change_in_place_before_the_backward_is_rejected():
    arguments = requiring_gradients(make_arguments())
    loss = rasterization(**arguments)[0].sum()
    with torch.no_grad():
        arguments["means"].add_(1)
    with pytest.raises(RuntimeError, match="modified by an inplace operation"):
        loss.backward()


def test_memory_layout_does_not_change_results():
    arguments = requiring_gradients(make_arguments())
    image, _, _ = rasterization(**arguments)
    scattered = {
        name: value.mT.contiguous().mT if isinstance(value, Tensor) and value.ndim > 1 else value
        for name, value in arguments.items()
    }
    assert not scattered["means"].is_contiguous()
    same, _, _ = rasterization(**scattered)
    assert torch.equal(image, same)


def test_threads_do_not_change_results():
    threads = torch.get_num_threads()
    arguments = requiring_gradients(make_arguments(300))
    results = []
    try:
        for count in (1, 3):
            torch.set_num_threads(count)
            image, alpha, _ = rasterization(**arguments)
            results.append([image, alpha, *gradients_of(arguments, image).values()])
    finally:
        torch.set_num_threads(threads)
    assert all(torch.equal(a, b) for a, b in zip(*results, strict=True))


def test_no_gaussians():
    arguments = requiring_gradients(make_arguments(0))
    arguments["backgrounds"] = torch.rand(1, 3, dtype=torch.float64)
    image, alpha, _ = rasterization(**arguments, render_mode="RGB+ED")
    assert torch.equal(image[..., :3], arguments["backgrounds"].expand(1, HEIGHT, WIDTH, 3))
    assert not image[..., 3].any()
    assert not alpha.any()
    gradients = gradients_of(arguments | {"backgrounds": arguments["means"]}, image, alpha)
    assert gradients["means"].shape == (0, 3)
    assert not gradients["viewmats"].any()


def test_signature_is_that_of_gsplat():
    parameters = inspect.signature(rasterization).parameters
    assert list(parameters) == GSPLAT_PARAMETERS
    required = [name for name, p in parameters.items() if p.default is inspect.Parameter.empty]
    assert required == GSPLAT_PARAMETERS[:9]


def test_memory_options_are_ignored():
    arguments = make_arguments()
    steered = rasterization(**arguments, packed=False, tile_size=8, channel_chunk=2, segmented=True)
    assert torch.equal(rasterization(**arguments)[0], steered[0])


class RollingShutter(enum.Enum):
    GLOBAL = 4
    ROLLING_TOP_TO_BOTTOM = 0


def test_global_shutter_of_any_enumeration_is_accepted():
    image, _, _ = rasterization(**make_arguments(), rolling_shutter=RollingShutter.GLOBAL)
    expected, _, _ = rasterization(**make_arguments())
    assert torch.equal(image, expected)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("far_plane", 100.0),
        ("radius_clip", 0.5),
        ("sh_degree", 4),
        ("sparse_grad", True),
        ("absgrad", True),
        ("distributed", True),
        ("camera_model", "fisheye"),
        ("covars", torch.zeros(50, 3, 3)),
        ("with_ut", True),
        ("with_eval3d", True),
        ("radial_coeffs", torch.zeros(1, 6)),
        ("tangential_coeffs", torch.zeros(1, 2)),
        ("thin_prism_coeffs", torch.zeros(1, 4)),
        ("ftheta_coeffs", "coefficients"),
        ("rolling_shutter", RollingShutter.ROLLING_TOP_TO_BOTTOM),
        ("viewmats_rs", torch.zeros(1, 4, 4)),
    ],
)
def test_unsupported_option_is_rejected(name, value):
    shown = r"a tensor \(" if isinstance(value, Tensor) else repr(value)
    with pytest.raises(NotImplementedError, match=f"^rasterization: {name}={shown}.* supported$"):
        rasterization(**make_arguments(), **{name: value})


def test_gradient_of_the_intrinsics_is_rejected():
    arguments = make_arguments()
    arguments["Ks"].requires_grad_()
    with pytest.raises(NotImplementedError, match="Ks"):
        rasterization(**arguments)
    with torch.no_grad():
        rasterization(**arguments)


def rejects(match: str, **changes: Any) -> None:
    with pytest.raises(ValueError, match=match) as caught:
        rasterization(**make_arguments() | changes)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "name", ["means", "quats", "scales", "opacities", "colors", "viewmats", "Ks", "backgrounds"]
)
def test_wrong_tensor_is_rejected(name):
    arguments = make_arguments() | {"backgrounds": torch.ones(1, 3, dtype=torch.float64)}
    good = arguments[name]
    for wrong in (good[..., :-1], good[None, None], torch.zeros((), dtype=good.dtype)):
        if name not in ("means", "viewmats", "colors"):  # These set the shapes of the others.
            rejects(rf"^{name}: expected torch.float64 \(.*, got torch.float64 \(", **{name: wrong})
    rejects(rf"^{name}: expected .*got .*float16", **{name: good.to(torch.float16)})
    rejects(rf"^{name}: expected .* on cpu, got .* on meta", **{name: good.to("meta")})
    with pytest.raises(TypeError, match=rf"^{name}: expected a tensor, got ndarray"):
        rasterization(**arguments | {name: good.numpy()})


@pytest.mark.parametrize(
    ("name", "shape"),
    [
        ("means", (50, 2)),
        ("means", (3,)),
        ("colors", (49, 3)),
        ("colors", (2, 50, 3)),
        ("viewmats", (4, 4)),
        ("viewmats", (0, 4, 4)),
    ],
)
def test_wrong_shape_is_rejected(name, shape):
    changes = {name: torch.zeros(shape, dtype=torch.float64)}
    if shape[0] == 0:
        changes["Ks"] = torch.zeros(0, 3, 3, dtype=torch.float64)
    rejects(rf"^{name}: expected", **changes)


def test_too_few_spherical_harmonics_are_rejected():
    rejects("^colors: expected .*4 spherical", sh_degree=1, colors=torch.zeros(50, 1, 3).double())


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("name", ["means", "quats", "scales", "colors"])
def test_value_that_is_not_finite_is_rejected(name, value):
    tensor = make_arguments()[name]
    tensor[3, 1] = value
    rejects(f"^{name}: expected finite numbers, got {value}$", **{name: tensor})


@pytest.mark.parametrize("value", [-0.1, 1.1, np.nan])
def test_opacity_out_of_range_is_rejected(value):
    opacities = make_arguments()["opacities"]
    opacities[7] = value
    rejects(rf"^opacities: expected numbers in \[0, 1\], got .*{value}", opacities=opacities)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("near_plane", 0.0),
        ("near_plane", np.nan),
        ("eps2d", -0.1),
        ("sh_degree", -1),
        ("render_mode", "rgb"),
        ("rasterize_mode", "fast"),
        ("width", 0),
        ("height", 65537),
    ],
)
def test_option_out_of_range_is_rejected(name, value):
    rejects(name, **{name: value})


def test_size_that_is_not_an_integer_is_rejected():
    with pytest.raises(TypeError, match="integer"):
        rasterization(**make_arguments() | {"width": 31.0})


def test_nearly_rigid_poses_are_projected_to_rigid_ones():
    arguments = make_arguments(dtype=torch.float32)
    image, _, _ = rasterization(**arguments)
    noise = torch.randn(1, 3, 3, generator=torch.Generator().manual_seed(0))
    arguments["viewmats"][:, :3, :3] *= 1 + 1e-5 * noise
    near, _, _ = rasterization(**arguments)
    assert (near - image).norm() < 1e-2 * image.norm()


@pytest.mark.parametrize("factor", [1.01, -1.0, np.nan])
def test_pose_that_is_not_rigid_is_rejected(factor):
    viewmats = make_arguments()["viewmats"]
    viewmats[:, :3, :3] *= factor
    rejects("^viewmats: expected a rigid transform, got", viewmats=viewmats)


@pytest.mark.parametrize("entry", [(0, 1), (1, 0), (2, 0), (2, 2)])
def test_intrinsics_of_another_form_are_rejected(entry):
    Ks = make_arguments()["Ks"]
    Ks[0][entry] = 0.5
    rejects("^Ks: expected", Ks=Ks)


def test_gradient_that_is_not_finite_is_rejected():
    arguments = requiring_gradients(make_arguments())
    image, _, _ = rasterization(**arguments)
    with pytest.raises(ValueError, match="dL_drgb"):
        (image * np.nan).sum().backward()


def test_without_torch_the_message_names_the_extra(monkeypatch):
    for name in [name for name in sys.modules if name.startswith("gslts.torch")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(ImportError, match=r"^gslts.torch needs PyTorch: pip install gslts\[torch"):
        __import__("gslts.torch")
