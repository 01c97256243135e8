"""Rendering of one view as a differentiable function of PyTorch."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from torch import Tensor
from torch.autograd.function import once_differentiable

# The core itself: a `GaussianMap` would check all values, as the rasterizer does anyway.
from gslts._core.map import GaussianViewDouble, GaussianViewFloat
from gslts._core.raster import RasterizerDouble, RasterizerFloat, RenderOptions
from gslts.core.camera import Camera
from gslts.core.gaussian_map import SH_C0, FloatArray
from gslts.rendering.rasterizer import scatter_rows
from gslts.torch.checks import require_finite
from gslts.types import Floats

MIN_SCALE_M = 1e-30
"""Replaces a scale of 0, which has no logarithm, m."""
RIGID_TOLERANCE = 1e-3
"""Maximum error of the singular values of a rotation; poses stored in float32 pass."""


def rasterize_view(
    means: Tensor,
    quats: Tensor,
    scales: Tensor,
    opacities: Tensor,
    colors: Tensor,
    viewmat: Tensor,
    K: Tensor,
    width: int,
    height: int,
    options: RenderOptions,
) -> tuple[Tensor, Tensor, Tensor]:
    """Render one view; the tensors are those of `rasterization` without leading dimensions.

    Args:
        means: [N,3] world, m.
        quats: [N,4] wxyz.
        scales: [N,3] m.
        opacities: [N] in [0, 1].
        colors: [N,D], or [N,K,3] spherical harmonics.
        viewmat: [4,4] camera_from_world, rigid.
        K: [3,3] intrinsics, px.
        width: Of the image, px.
        height: Of the image, px.
        options: Of the rasterizer.

    Returns:
        Colours on black [H,W,D], expected depth [H,W,1] and alpha [H,W,1].

    Raises:
        ValueError: The viewmat is not rigid, or a value is not finite.
    """
    camera = _camera_of(viewmat, K, width, height)
    color, depth, alpha = _RasterizeView.apply(  # type: ignore[no-untyped-call]
        means, quats, scales, opacities, colors, viewmat, camera, options
    )
    return color, depth[..., None], alpha[..., None]


class _RasterizeView(torch.autograd.Function):
    """Autograd function of `rasterize_view`.

    Each call keeps a rasterizer of its own for the backward pass, so that several forward passes
    may come first. This costs no time, as the core reuses the memory of earlier ones.
    """

    @staticmethod
    def forward(
        ctx: Any,
        means: Tensor,
        quats: Tensor,
        scales: Tensor,
        opacities: Tensor,
        colors: Tensor,
        viewmat: Tensor,  # noqa: ARG004  # For its gradient; `camera` has its values.
        camera: Camera,
        options: RenderOptions,
    ) -> tuple[Tensor, ...]:
        """Render colours [H,W,D], depth [H,W] and alpha [H,W]."""
        rasterizer: Any = RasterizerDouble() if means.dtype == torch.float64 else RasterizerFloat()
        gaussians = _gaussians_of(means, quats, scales, opacities, colors)
        try:
            images = rasterizer.forward(gaussians, camera=camera, options=options, mask=None)
        except ValueError:
            # Name an array that is not finite as the caller does.
            require_finite(means=means, quats=quats, scales=scales, colors=colors)
            raise
        ctx.set_materialize_grads(False)
        ctx.save_for_backward(means, quats, scales, opacities, colors)
        ctx.rasterizer, ctx.gaussians, ctx.camera = rasterizer, gaussians, camera
        color = "features" if _role_of(colors) == "features" else "rgb"
        return tuple(torch.from_numpy(images[name]) for name in (color, "depth", "alpha"))

    @staticmethod
    @once_differentiable
    def backward(
        ctx: Any, dL_dcolor: Tensor | None, dL_ddepth: Tensor | None, dL_dalpha: Tensor | None
    ) -> tuple[Tensor | None, ...]:
        """Compute the gradients of the inputs; None for those that are 0 or not needed."""
        _, _, scales, opacities, colors = ctx.saved_tensors
        role = _role_of(colors)
        gradients = ctx.rasterizer.backward(
            ctx.gaussians,
            dL_drgb=None if role == "features" else _numpy(dL_dcolor),
            dL_ddepth=_numpy(dL_ddepth),
            dL_dalpha=_numpy(dL_dalpha),
            dL_dfeatures=_numpy(dL_dcolor) if role == "features" else None,
            statistics=False,
        )

        def dense(argument: int, rendered: FloatArray) -> Any:
            """Return the gradient of all Gaussians: 0 for culled ones; None if not needed."""
            if not ctx.needs_input_grad[argument]:
                return None
            return torch.from_numpy(scatter_rows(gradients["rows"], rendered, len(scales)))

        dL_dscales = dense(2, gradients["dL_dlog_scales"])
        if dL_dscales is not None:
            # d log|s| / ds = 1 / s. The images depend on s^2, whose derivative is 0 at s = 0.
            dL_dscales.div_(scales).masked_fill_(scales == 0, 0)
        dL_dopacities = dense(3, gradients["dL_dlogit_opacities"])
        if dL_dopacities is not None:
            opacity = _off_bounds(opacities)
            dL_dopacities.div_(opacity.mul_(1 - opacity))
        dL_dcolors = dense(4, gradients["dL_dfeatures" if role == "features" else "dL_dsh"])
        if dL_dcolors is not None and role == "rgb":
            dL_dcolors = dL_dcolors[:, 0].div_(SH_C0)
        dL_dviewmat = _viewmat_gradient(ctx.camera, gradients["dL_dtwist"])
        return (
            dense(0, gradients["dL_dmeans"]),
            dense(1, gradients["dL_dquats"]),
            dL_dscales,
            dL_dopacities,
            dL_dcolors,
            torch.from_numpy(dL_dviewmat).to(scales.dtype),
            None,
            None,
        )


def _role_of(colors: Tensor) -> str:
    """Return the map attribute for colours; RGB as SH of degree 0 is faster to blend."""
    if colors.ndim == 3:
        return "sh"
    return "rgb" if colors.shape[1] == 3 else "features"


def _gaussians_of(
    means: Tensor, quats: Tensor, scales: Tensor, opacities: Tensor, colors: Tensor
) -> GaussianViewDouble | GaussianViewFloat:
    """Convert activated to stored values; without a copy where possible."""
    role = _role_of(colors)
    if role == "features":
        sh, features = means.new_zeros((len(means), 1, 3)), colors
    else:
        sh = colors if role == "sh" else (colors - 0.5).div_(SH_C0)[:, None]
        features = means.new_zeros((len(means), 0))
    view = GaussianViewDouble if means.dtype == torch.float64 else GaussianViewFloat
    return view(
        means=_numpy(means),
        quats=_numpy(quats),
        log_scales=_numpy(scales.abs().clamp_(min=MIN_SCALE_M).log_()),
        logit_opacities=_numpy(_off_bounds(opacities).logit_()),
        sh=_numpy(sh),
        features=_numpy(features),
        origin=np.zeros(3),
    )


def _off_bounds(opacities: Tensor) -> Tensor:
    """Clamp opacities away from 0 and 1, whose logits are infinite, by half an epsilon."""
    margin = torch.finfo(opacities.dtype).eps / 2
    return opacities.clamp(margin, 1 - margin)


def _camera_of(viewmat: Tensor, K: Tensor, width: int, height: int) -> Camera:
    """Make the camera of a view, with the rotation nearest to that of the viewmat.

    Raises:
        ValueError: The viewmat differs by more than RIGID_TOLERANCE from a rigid one, or K is not
            of the form ((fx, 0, cx), (0, fy, cy), (0, 0, 1)).
    """
    camera_from_world = _numpy(viewmat).astype(np.float64)
    rotation, is_rigid = np.eye(3), bool(np.isfinite(camera_from_world).all())
    if is_rigid:
        left, stretch, right = np.linalg.svd(camera_from_world[:3, :3])
        rotation = left @ right
        error = np.concatenate([stretch - 1, camera_from_world[3] - (0, 0, 0, 1)])
        is_rigid = abs(error).max() <= RIGID_TOLERANCE and np.linalg.det(rotation) > 0
    if not is_rigid:
        raise ValueError(f"viewmats: expected a rigid transform, got {viewmat.tolist()}")
    (fx, skew, cx), (below, fy, cy), last = K.tolist()
    if skew != 0 or below != 0 or last != [0, 0, 1]:
        raise ValueError(f"Ks: expected [[fx, 0, cx], [0, fy, cy], [0, 0, 1]], got {K.tolist()}")
    world_from_camera = np.eye(4)
    world_from_camera[:3, :3] = rotation.T
    world_from_camera[:3, 3] = -rotation.T @ camera_from_world[:3, 3]
    return Camera(
        fx=fx, fy=fy, cx=cx, cy=cy, width=width, height=height, world_from_camera=world_from_camera
    )


def _viewmat_gradient(camera: Camera, dL_dtwist: Floats) -> Floats:
    """Compute the [4,4] gradient G of the viewmat V, tangent to the rigid transforms at V.

    With V = (R, t), world_from_camera exp(xi) has the viewmat exp(-xi) V, which moves by
    dR = -[phi]x R and dt = -rho - phi x t. Every tangent is some ([a]x R, b). The one for which
    <G, dV> = -2 a.phi - b.(rho + phi x t) is dL = g_rho.rho + g_phi.phi for all xi has
    b = -g_rho and a = -(g_phi + t x b) / 2.
    """
    rotation = camera.world_from_camera[:3, :3].T
    translation = -rotation @ camera.world_from_camera[:3, 3]
    gradient = np.zeros((4, 4))
    gradient[:3, 3] = -dL_dtwist[:3]
    x, y, z = -0.5 * (dL_dtwist[3:] + np.cross(translation, gradient[:3, 3]))
    gradient[:3, :3] = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) @ rotation
    return gradient


def _numpy(tensor: Tensor | None) -> Any:
    """Return a tensor as a C-contiguous array, without a copy if possible; None for None."""
    return None if tensor is None else tensor.detach().contiguous().numpy()
