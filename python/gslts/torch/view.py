"""One view as a function of tensors that PyTorch can differentiate."""

from __future__ import annotations

from math import pi, sqrt
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.autograd.function import once_differentiable

from gslts.camera import Camera
from gslts.gaussian_map import GaussianMap
from gslts.render import Rasterizer, RenderOptions
from gslts.torch.checks import require_finite

SH_C0 = 0.5 / sqrt(pi)  # Value of the constant spherical harmonic.
MIN_SCALE_M = 1e-30  # Stands for a scale of 0, which has no logarithm.
RIGID_TOLERANCE = 1e-3  # Of the singular values of a rotation; poses kept in float32 pass.


class RasterizeView(torch.autograd.Function):
    """One view: colours without background [H,W,D], expected depth and alpha, both [H,W,1].

    Each call has a rasterizer of its own, which waits for the backward pass: several forwards may
    come before it. That costs no time, as the core recycles the memory of those before.
    """

    @staticmethod
    def forward(
        ctx: Any,
        means: Tensor,
        quats: Tensor,
        scales: Tensor,
        opacities: Tensor,
        colors: Tensor | None,
        viewmat: Tensor,  # noqa: ARG004  # `camera` has its numbers; it is here for its gradient.
        camera: Camera,
        options: RenderOptions,
    ) -> tuple[Tensor, ...]:
        """Renders; without `colors`, the colours mean nothing."""
        rasterizer = Rasterizer(_numpy(means).dtype)
        try:
            gaussians = _map_of(means, quats, scales, opacities, colors)
            images = rasterizer.forward(gaussians, camera, options)
        except ValueError:
            # A number is not finite, in an array that the caller knows by another name.
            require_finite(means=means, quats=quats, scales=scales, colors=colors)
            raise
        ctx.set_materialize_grads(False)
        ctx.save_for_backward(means, quats, scales, opacities, colors)
        ctx.rasterizer, ctx.camera = rasterizer, camera
        color = images.features if _role_of(colors) == "features" else images.rgb
        arrays = (color, images.depth[..., None], images.alpha[..., None])
        return tuple(torch.from_numpy(array) for array in arrays)

    @staticmethod
    @once_differentiable
    def backward(
        ctx: Any, dL_dcolor: Tensor | None, dL_ddepth: Tensor | None, dL_dalpha: Tensor | None
    ) -> tuple[Tensor | None, ...]:
        """None stands for a gradient that is zero or not asked for."""
        _, _, scales, opacities, colors = ctx.saved_tensors
        role = _role_of(colors)
        gradients = ctx.rasterizer.backward(
            **{
                name: None if dL is None else _numpy(dL)
                for name, dL in (
                    ("dL_dfeatures" if role == "features" else "dL_drgb", dL_dcolor),
                    ("dL_ddepth", None if dL_ddepth is None else dL_ddepth[..., 0]),
                    ("dL_dalpha", None if dL_dalpha is None else dL_dalpha[..., 0]),
                )
            }
        )
        rows = torch.from_numpy(gradients.rows.astype(np.int64))

        def dense(argument: int, seen: Tensor) -> Tensor | None:
            """The gradient of all Gaussians: zero for those not seen."""
            if not ctx.needs_input_grad[argument]:
                return None
            return seen.new_zeros((len(scales), *seen.shape[1:])).index_copy_(0, rows, seen)

        # d log|s| / ds = 1 / s. The images depend on s^2, which has no slope where s is 0.
        scale = scales[rows]
        dL_dscales = torch.from_numpy(gradients.dL_dlog_scales) / torch.where(scale == 0, 1, scale)
        opacity = _off_bounds(opacities[rows])
        dL_dopacities = torch.from_numpy(gradients.dL_dlogit_opacities) / (opacity * (1 - opacity))
        dL_dsh = torch.from_numpy(gradients.dL_dsh)
        dL_dcolors = {
            "sh": dL_dsh,
            "rgb": dL_dsh[:, 0] / SH_C0,
            "features": torch.from_numpy(gradients.dL_dfeatures),
        }
        dL_dviewmat = torch.from_numpy(_viewmat_gradient(ctx.camera, gradients.dL_dtwist))
        return (
            dense(0, torch.from_numpy(gradients.dL_dmeans)),
            dense(1, torch.from_numpy(gradients.dL_dquats)),
            dense(2, dL_dscales),
            dense(3, dL_dopacities),
            dense(4, dL_dcolors[role]),
            dL_dviewmat.to(scales.dtype),
            None,
            None,
        )


def _role_of(colors: Tensor | None) -> str:
    """What the colours of a view become in the map; RGB as SH of degree 0 is faster to blend."""
    if colors is None or colors.ndim == 3:
        return "sh"
    return "rgb" if colors.shape[1] == 3 else "features"


def _map_of(
    means: Tensor, quats: Tensor, scales: Tensor, opacities: Tensor, colors: Tensor | None
) -> GaussianMap:
    """The map of the stored values whose activated ones these are."""
    sh, features = means.new_zeros((len(means), 1, 3)), means.new_zeros((len(means), 0))
    if colors is not None:
        role = _role_of(colors)
        if role == "sh":
            sh = colors
        elif role == "rgb":
            sh = ((colors - 0.5) / SH_C0)[:, None]
        else:
            features = colors
    return GaussianMap(
        means=_numpy(means),
        quats=_numpy(quats),
        log_scales=_numpy(scales.abs().clamp_(min=MIN_SCALE_M).log_()),
        logit_opacities=_numpy(_off_bounds(opacities).logit_()),
        sh=_numpy(sh),
        features=_numpy(features),
    )


def _off_bounds(opacities: Tensor) -> Tensor:
    """Keeps opacities off 0 and 1, whose logits are infinite, by half the rounding of 1."""
    margin = torch.finfo(opacities.dtype).eps / 2
    return opacities.clamp(margin, 1 - margin)


def camera_of(viewmat: Tensor, K: Tensor, width: int, height: int) -> Camera:
    """The camera of a view, its rotation the one nearest to the viewmat's.

    Raises:
        ValueError: The viewmat is further than RIGID_TOLERANCE from rigid, or K is not of the form
            ((fx, 0, cx), (0, fy, cy), (0, 0, 1)).
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


def _viewmat_gradient(camera: Camera, dL_dtwist: NDArray[np.float64]) -> NDArray[np.float64]:
    """[4,4] gradient G with respect to the viewmat V, tangent to the rigid transforms at V.

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


def _numpy(tensor: Tensor) -> NDArray[Any]:
    """The tensor as an array that shares its memory."""
    array: NDArray[Any] = tensor.detach().numpy()
    return array
