"""`gslts.torch.rasterization` in autograd: batches, repeated backwards, layouts, threads."""

import pytest
import torch
from torch import Tensor
from torch_arguments import (
    DIFFERENTIABLE,
    HEIGHT,
    WIDTH,
    assert_same,
    gradients_of,
    make_arguments,
    requiring_gradients,
)

from gslts.torch import rasterization


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
