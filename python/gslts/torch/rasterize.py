"""Replacement for `rasterization` of gsplat."""

from __future__ import annotations

from enum import Enum
from itertools import repeat
from math import prod
from operator import index
from typing import Any, Literal

import torch
from torch import Tensor

from gslts.rendering.rasterizer import RenderOptions
from gslts.torch.checks import check_tensors, require_supported, require_valid
from gslts.torch.view import rasterize_view

RENDER_MODES = ("RGB", "D", "ED", "RGB+D", "RGB+ED")
"""Render modes of gsplat."""
RASTERIZE_MODES = ("classic", "antialiased")
"""Rasterize modes of gsplat."""
FAR_PLANE_M = 1e10
"""Default of gsplat, m: there is no far plane."""
SH_BASES = (1, 4, 9, 16)
"""Number of spherical harmonics of the degrees 0 to 3."""
MIN_ALPHA = 1 / 255
"""Alpha below which a Gaussian is not blended, that of gsplat."""


def rasterization(
    means: Tensor,
    quats: Tensor,
    scales: Tensor,
    opacities: Tensor,
    colors: Tensor,
    viewmats: Tensor,
    Ks: Tensor,
    width: int,
    height: int,
    near_plane: float = 0.01,
    far_plane: float = FAR_PLANE_M,
    radius_clip: float = 0.0,
    eps2d: float = 0.3,
    sh_degree: int | None = None,
    packed: bool = True,  # noqa: ARG001
    tile_size: int = 16,  # noqa: ARG001
    backgrounds: Tensor | None = None,
    render_mode: Literal["RGB", "D", "ED", "RGB+D", "RGB+ED"] = "RGB",
    sparse_grad: bool = False,
    absgrad: bool = False,
    rasterize_mode: Literal["classic", "antialiased"] = "classic",
    channel_chunk: int = 32,  # noqa: ARG001
    distributed: bool = False,
    camera_model: str = "pinhole",
    segmented: bool = False,  # noqa: ARG001
    covars: Tensor | None = None,
    with_ut: bool = False,
    with_eval3d: bool = False,
    radial_coeffs: Tensor | None = None,
    tangential_coeffs: Tensor | None = None,
    thin_prism_coeffs: Tensor | None = None,
    ftheta_coeffs: object = None,
    rolling_shutter: str | Enum = "GLOBAL",
    viewmats_rs: Tensor | None = None,
) -> tuple[Tensor, Tensor, dict[str, Any]]:
    """Render N Gaussians from C cameras (3D Gaussian splatting, Kerbl et al. 2023).

    All tensors have one dtype, float32 (the fast kernel) or float64, and are on the CPU. Leading
    dimensions `...` are a batch of scenes. The result is differentiable once with respect to
    `means`, `quats`, `scales`, `opacities`, `colors`, `viewmats` and `backgrounds`. It does not
    depend on the number of threads, `torch.get_num_threads()`.

    Args:
        means: [..., N, 3] centres, world frame, m.
        quats: [..., N, 4] wxyz, rotations from the axes of the Gaussian to the world; of any
            length.
        scales: [..., N, 3] standard deviations, m.
        opacities: [..., N] in [0, 1].
        colors: [..., N, D] or, per camera, [..., C, N, D], any values in any number of channels;
            with `sh_degree`, spherical harmonics [..., N, K, 3] or [..., C, N, K, 3], colour =
            max(0, 0.5 + SH).
        viewmats: [..., C, 4, 4] rigid, x_in_camera = viewmat @ x_in_world; OpenCV axes.
        Ks: [..., C, 3, 3] intrinsics without skew, px.
        width: Of the images, px.
        height: Of the images, px.
        near_plane: Gaussians with centre depth z <= near_plane are culled, m. > 0
        far_plane: 1e10 or more: no far plane.
        radius_clip: 0: no Gaussian is culled by its radius.
        eps2d: Variance added to each projected covariance, px^2. >= 0
        sh_degree: Degree of the spherical harmonics to use, 0 to 3; None for plain colours.
        packed: Ignored, as `tile_size`, `channel_chunk` and `segmented`, which trade memory for
            speed in gsplat.
        tile_size: Ignored.
        backgrounds: [..., C, D] colours behind the Gaussians; None for 0. Depth has no background.
        render_mode: "RGB": colours, sum w_i c_i; "D": accumulated depth, sum w_i z_i; "ED":
            expected depth, sum w_i z_i / sum w_i, 0 where alpha is 0; "RGB+D", "RGB+ED": colours
            with depth as the last channel.
        sparse_grad: False.
        absgrad: False.
        rasterize_mode: "antialiased" scales opacity by sqrt(det(cov2d) / det(cov2d + eps2d I))
            (Mip-Splatting, Yu et al. 2024).
        channel_chunk: Ignored.
        distributed: False.
        camera_model: "pinhole".
        segmented: Ignored.
        covars: None.
        with_ut: False.
        with_eval3d: False.
        radial_coeffs: None.
        tangential_coeffs: None.
        thin_prism_coeffs: None.
        ftheta_coeffs: None.
        rolling_shutter: "GLOBAL", or an enumeration member of that name.
        viewmats_rs: None.

    Returns:
        Images [..., C, height, width, X] with X = D, 1 or D + 1 channels; alpha [..., C, height,
        width, 1]; and a dictionary of the integers `width`, `height`, `n_cameras` = C and
        `n_batches`, the product of the leading dimensions.

    Raises:
        NotImplementedError: An option has a value that is not listed above, or `Ks` requires a
            gradient.
        TypeError: An argument is not a tensor, or a size is not an integer.
        ValueError: A tensor has a wrong shape, dtype or device, a value is not finite or is out of
            range, a viewmat is not rigid, or `backward` got a gradient that is not finite.
    """
    require_supported(
        far_plane=(far_plane, far_plane >= FAR_PLANE_M),
        radius_clip=(radius_clip, radius_clip <= 0),
        sh_degree=(sh_degree, sh_degree is None or sh_degree < len(SH_BASES)),
        sparse_grad=(sparse_grad, not sparse_grad),
        absgrad=(absgrad, not absgrad),
        distributed=(distributed, not distributed),
        camera_model=(camera_model, camera_model == "pinhole"),
        covars=(covars, covars is None),
        with_ut=(with_ut, not with_ut),
        with_eval3d=(with_eval3d, not with_eval3d),
        radial_coeffs=(radial_coeffs, radial_coeffs is None),
        tangential_coeffs=(tangential_coeffs, tangential_coeffs is None),
        thin_prism_coeffs=(thin_prism_coeffs, thin_prism_coeffs is None),
        ftheta_coeffs=(ftheta_coeffs, ftheta_coeffs is None),
        rolling_shutter=(
            rolling_shutter,
            getattr(rolling_shutter, "name", rolling_shutter) == "GLOBAL",
        ),
        viewmats_rs=(viewmats_rs, viewmats_rs is None),
    )
    require_valid(
        near_plane=(near_plane, near_plane > 0, "a number above 0"),
        eps2d=(eps2d, eps2d >= 0, "a number of at least 0"),
        sh_degree=(sh_degree, sh_degree is None or sh_degree >= 0, "None or 0 to 3"),
        render_mode=(render_mode, render_mode in RENDER_MODES, f"one of {RENDER_MODES}"),
        rasterize_mode=(
            rasterize_mode,
            rasterize_mode in RASTERIZE_MODES,
            f"one of {RASTERIZE_MODES}",
        ),
    )
    only_depth = not render_mode.startswith("RGB")
    check_tensors(
        means=means,
        quats=quats,
        scales=scales,
        opacities=opacities,
        colors=colors,
        viewmats=viewmats,
        Ks=Ks,
        backgrounds=None if only_depth else backgrounds,
        sh_degree=sh_degree,
    )
    batch, size, cameras = means.shape[:-2], means.shape[-2], viewmats.shape[-3]
    if only_depth:  # An image without colour channels, and depth.
        colors, sh_degree, backgrounds = means.new_zeros((*batch, size, 0)), None, None
    elif sh_degree is not None and colors.shape[-2] not in SH_BASES:
        colors = colors[..., : (sh_degree + 1) ** 2, :]
    options = RenderOptions(
        near_m=near_plane,
        near_sigmas=0,  # As in gsplat.
        sh_degree=sh_degree or 0,
        clamp_colors=sh_degree is not None,
        eps2d_px2=eps2d,
        antialias=rasterize_mode == "antialiased",
        surface_depth=False,  # As in gsplat.
        alpha_min=MIN_ALPHA,
        threads=torch.get_num_threads(),
    )

    image, depth, alpha = _render_views(
        (means, quats, scales, opacities),
        colors,
        viewmats,
        Ks,
        (index(width), index(height)),
        options,
        colors_by_camera=colors.ndim > len(batch) + (2 if sh_degree is None else 3),
    )
    if backgrounds is not None:
        image = image + (1 - alpha) * backgrounds[..., None, None, :]
    if render_mode != "RGB":
        depth = depth if render_mode.endswith("ED") else depth * alpha
        image = torch.cat([image, depth], dim=-1)
    meta = {"width": width, "height": height, "n_cameras": cameras, "n_batches": prod(batch)}
    return image, alpha, meta


def _render_views(
    shared: tuple[Tensor, ...],
    colors: Tensor,
    viewmats: Tensor,
    Ks: Tensor,
    size: tuple[int, int],
    options: RenderOptions,
    *,
    colors_by_camera: bool,
) -> tuple[Tensor, ...]:
    """Render all cameras of all scenes; return images, expected depths and alphas.

    Args:
        shared: Tensors that all cameras of a scene share.
        colors: As of `rasterization`.
        viewmats: As of `rasterization`.
        Ks: As of `rasterization`.
        size: Width and height, px.
        options: Of the rasterizer.
        colors_by_camera: True if `colors` has a dimension of cameras.
    """
    batch, cameras = viewmats.shape[:-3], viewmats.shape[-3]

    def by_view(tensor: Tensor, *, by_camera: bool) -> list[Tensor]:
        """Split by view: all cameras of the first scene, then those of the next."""
        parts = _split(tensor, len(batch) + by_camera)
        return parts if by_camera else [part for part in parts for _ in range(cameras)]

    views = map(
        rasterize_view,
        *(by_view(tensor, by_camera=False) for tensor in shared),
        by_view(colors, by_camera=colors_by_camera),
        by_view(viewmats, by_camera=True),
        by_view(Ks, by_camera=True),
        *(repeat(length) for length in size),
        repeat(options),
    )
    return tuple(_join(parts, (*batch, cameras)) for parts in zip(*views, strict=True))


def _split(tensor: Tensor, dims: int) -> list[Tensor]:
    """Split a tensor along its first `dims` dimensions."""
    if prod(tensor.shape[:dims]) == 1:  # A view of the tensor, so that its gradient is not copied.
        return [tensor.reshape(tensor.shape[dims:])]
    return list(tensor.flatten(0, dims - 1).unbind())


def _join(parts: tuple[Tensor, ...], shape: tuple[int, ...]) -> Tensor:
    """Stack parts along new first dimensions of the given shape."""
    joined = parts[0] if len(parts) == 1 else torch.stack(parts)
    return joined.reshape(*shape, *parts[0].shape)
