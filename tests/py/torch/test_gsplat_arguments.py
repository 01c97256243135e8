"""The arguments of gsplat: those accepted, and what `gslts.torch.rasterization` rejects."""

import enum
import inspect
import sys
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor
from torch_arguments import make_arguments, requiring_gradients

from gslts.torch import rasterization

# fmt: off
GSPLAT_PARAMETERS = [
    "means", "quats", "scales", "opacities", "colors", "viewmats", "Ks", "width", "height",
    "near_plane", "far_plane", "radius_clip", "eps2d", "sh_degree", "packed", "tile_size",
    "backgrounds", "render_mode", "sparse_grad", "absgrad", "rasterize_mode", "channel_chunk",
    "distributed", "camera_model", "segmented", "covars", "with_ut", "with_eval3d", "radial_coeffs",
    "tangential_coeffs", "thin_prism_coeffs", "ftheta_coeffs", "rolling_shutter", "viewmats_rs",
]
# fmt: on


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
    with pytest.raises(ImportError, match=r"^gslts.torch needs PyTorch: pip install 'gslts\[torch"):
        __import__("gslts.torch")
