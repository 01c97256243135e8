"""Readable reference of `gslts.torch.rasterization`: one view, differentiated by PyTorch itself.

One Gaussian after the other and all pixels at once, like `oracle`, but with gsplat's arguments.
"""

from __future__ import annotations

import oracle
import torch
from torch import Tensor

ALPHA_MIN, ALPHA_MAX, TRANSMITTANCE_MIN = 1 / 255, 0.99, 1e-4


def rotation_matrices(quats: Tensor) -> Tensor:
    """[N,3,3] of [N,4] wxyz: with the unit vector part v, I + 2 w [v]x + 2 [v]x^2."""
    w, x, y, z = torch.nn.functional.normalize(quats, dim=1).T
    zero = torch.zeros_like(w)
    cross = torch.stack([zero, -z, y, z, zero, -x, -y, x, zero], dim=1).reshape(-1, 3, 3)
    return torch.eye(3, dtype=quats.dtype) + 2 * w[:, None, None] * cross + 2 * cross @ cross


def evaluate_sh(sh: Tensor, directions: Tensor, degree: int) -> Tensor:
    """[N,3] colours of [N,K,3] spherical harmonics."""
    unit = torch.nn.functional.normalize(directions, dim=1)
    basis = torch.stack(oracle.sh_functions(*unit.T)[: (degree + 1) ** 2], dim=1)
    return (0.5 + torch.einsum("nk,nkc->nc", basis, sh[:, : basis.shape[1]])).clamp(min=0)


def projected_covariances(
    quats: Tensor, scales: Tensor, rotation: Tensor, in_camera: Tensor, K: Tensor, size: Tensor
) -> Tensor:
    """[N,2,2] J W R S S^T R^T W^T J^T (EWA splatting, Zwicker et al. 2001)."""
    focal, centre, z = K.diagonal()[:2], K[:2, 2], in_camera[:, 2]
    # The affine approximation is taken at most 15 % of the image size outside the image.
    low, high = (-0.15 * size - centre) / focal, (1.15 * size - centre) / focal
    tan = torch.maximum(low, torch.minimum(high, in_camera[:, :2] / z[:, None]))
    jacobians = torch.cat(
        [torch.eye(2, dtype=K.dtype).expand(len(z), 2, 2), -tan[..., None]], dim=2
    )
    jacobians = jacobians * focal[:, None] / z[:, None, None]
    factors = jacobians @ rotation @ rotation_matrices(quats) * scales[:, None]
    return factors @ factors.mT


def render(
    means: Tensor,
    quats: Tensor,
    scales: Tensor,
    opacities: Tensor,
    colors: Tensor,
    viewmat: Tensor,
    K: Tensor,
    width: int,
    height: int,
    *,
    near_plane: float = 0.01,
    eps2d: float = 0.3,
    sh_degree: int | None = None,
    antialiased: bool = False,
) -> tuple[Tensor, Tensor, Tensor]:
    """Colours [H,W,D], accumulated depth [H,W,1] and alpha [H,W,1]; the background is black."""
    rotation, translation = viewmat[:3, :3], viewmat[:3, 3]
    in_camera = means @ rotation.T + translation
    seen = torch.nonzero(in_camera[:, 2] > near_plane)[:, 0]
    seen = seen[torch.argsort(in_camera[seen, 2], stable=True)]
    in_camera = in_camera[seen]

    size = torch.tensor([width, height], dtype=means.dtype)
    covars = projected_covariances(quats[seen], scales[seen], rotation, in_camera, K, size)
    blurred = covars + eps2d * torch.eye(2, dtype=means.dtype)
    centres = in_camera[:, :2] / in_camera[:, 2:] * K.diagonal()[:2] + K[:2, 2]
    colors, opacities = colors[seen], opacities[seen]
    if sh_degree is not None:
        colors = evaluate_sh(colors, means[seen] + rotation.T @ translation, sh_degree)
    if antialiased:
        opacities = opacities * (torch.det(covars) / torch.det(blurred)).sqrt()

    rows, columns = torch.meshgrid(torch.arange(height), torch.arange(width), indexing="ij")
    pixels = torch.stack([columns, rows], dim=2).to(means.dtype) + 0.5
    color = torch.zeros(height, width, colors.shape[-1], dtype=means.dtype)
    depth, alpha = (torch.zeros(height, width, 1, dtype=means.dtype) for _ in range(2))
    transmittance, ended = torch.ones_like(alpha), torch.zeros_like(alpha, dtype=torch.bool)
    for i in range(len(seen)):
        offsets = pixels - centres[i]
        distance2 = (offsets @ torch.inverse(blurred[i]) * offsets).sum(dim=2, keepdim=True)
        alpha_i = opacities[i] * torch.exp(-0.5 * distance2)
        blended = (alpha_i >= ALPHA_MIN) & ~ended
        alpha_i = alpha_i.clamp(max=ALPHA_MAX)
        after = transmittance * (1 - alpha_i)
        ended = ended | (blended & (after < TRANSMITTANCE_MIN))
        blended = blended & ~ended
        weight = torch.where(blended, alpha_i * transmittance, 0)
        transmittance = torch.where(blended, after, transmittance)
        color = color + weight * colors[i]
        depth = depth + weight * in_camera[i, 2]
        alpha = alpha + weight
    return color, depth, alpha
