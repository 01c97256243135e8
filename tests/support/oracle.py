"""Readable reference renderer in numpy float64: one Gaussian after the other, all pixels at once.

Written from the papers and the conventions of `gslts.render`, not from the C++ code.
"""

from dataclasses import dataclass
from math import pi, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gslts import Camera, GaussianMap, RenderOptions

Array = NDArray[np.float64]

# Real spherical harmonics, with the signs of 3DGS (Condon-Shortley).
C0 = 0.5 / sqrt(pi)
C1 = sqrt(3 / (4 * pi))
C2 = sqrt(15 / (4 * pi))
C3 = sqrt(35 / (32 * pi)), sqrt(105 / (4 * pi)), sqrt(21 / (32 * pi))


@dataclass(frozen=True)
class Rendering:
    rgb: Array  # [H,W,3]
    depth: Array  # [H,W]
    alpha: Array  # [H,W]
    features: Array  # [H,W,D]
    margin: Array  # [H,W] least relative distance to a threshold: small means that it may flip
    max_flip: float  # most that a flip at a threshold changes alpha
    max_weights: Array  # [N]
    pixel_counts: NDArray[np.int64]  # [N]


def rotation_matrices(quats: Array) -> Array:
    """[N,3,3] of [N,4] wxyz of any length."""
    norms = np.linalg.norm(quats, axis=1, keepdims=True)
    unit = np.where(norms < 1e-12, [1.0, 0, 0, 0], quats / np.where(norms < 1e-12, 1, norms))
    w, x, y, z = unit.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def sh_functions(x: Any, y: Any, z: Any) -> list[Any]:
    """The 16 basis functions at unit vectors, given as three arrays or three tensors."""
    a, b, c = C3
    return [
        C0 + 0 * x,
        -C1 * y,
        C1 * z,
        -C1 * x,
        C2 * x * y,
        -C2 * y * z,
        C2 / sqrt(12) * (2 * z * z - x * x - y * y),
        -C2 * x * z,
        C2 / 2 * (x * x - y * y),
        -a * y * (3 * x * x - y * y),
        b * x * y * z,
        -c * y * (4 * z * z - x * x - y * y),
        sqrt(7 / (16 * pi)) * z * (2 * z * z - 3 * x * x - 3 * y * y),
        -c * x * (4 * z * z - x * x - y * y),
        b / 2 * z * (x * x - y * y),
        -a * x * (x * x - 3 * y * y),
    ]


def colours(gaussians: GaussianMap, means_in_world: Array, camera: Camera, degree: int) -> Array:
    offsets = means_in_world - camera.world_from_camera[:3, 3]
    lengths = np.linalg.norm(offsets, axis=1, keepdims=True)
    directions = offsets / np.maximum(lengths, 1e-300)
    bases = (min(degree, gaussians.sh_degree) + 1) ** 2
    basis = np.stack(sh_functions(*directions.T)[:bases], axis=1)
    sh = gaussians.sh[:, :bases].astype(np.float64)
    return 0.5 + np.einsum("nk,nkc->nc", basis, sh)


def project_covariances(
    gaussians: GaussianMap, x_in_camera: Array, camera: Camera
) -> tuple[Array, Array, Array]:
    """Project the covariances of Gaussians; returns three arrays.

    [N,2,2] covariance of the image position, [N,2] its covariance with the depth, and [N] standard
    deviation of the depth. J W R S S^T R^T W^T J^T, as in EWA splatting (Zwicker et al. 2001).
    """
    scales = np.exp(gaussians.log_scales.astype(np.float64))
    rotations = rotation_matrices(gaussians.quats.astype(np.float64))
    x, y, z = x_in_camera.T
    # The affine approximation is taken at most 15 % of the image size outside the image.
    margin_x, margin_y = 0.15 * camera.width / camera.fx, 0.15 * camera.height / camera.fy
    tan_x = np.clip(
        x / z, -camera.cx / camera.fx - margin_x, (camera.width - camera.cx) / camera.fx + margin_x
    )
    tan_y = np.clip(
        y / z, -camera.cy / camera.fy - margin_y, (camera.height - camera.cy) / camera.fy + margin_y
    )
    zero = np.zeros_like(z)
    jacobians = np.array(
        [
            [camera.fx / z, zero, -camera.fx * tan_x / z],
            [zero, camera.fy / z, -camera.fy * tan_y / z],
        ]
    )
    camera_from_world = camera.world_from_camera[:3, :3].T
    axes = camera_from_world @ rotations * scales[:, None, :]
    factors = np.moveaxis(jacobians, 2, 0) @ axes
    covars = factors @ factors.transpose(0, 2, 1)
    return covars, np.einsum("nij,nj->ni", factors, axes[:, 2]), np.linalg.norm(axes[:, 2], axis=1)


def render(
    gaussians: GaussianMap, camera: Camera, options: RenderOptions | None = None
) -> Rendering:
    options = RenderOptions() if options is None else options
    # Relative to the camera first: the world's origin may be far away.
    offsets = gaussians.means.astype(np.float64) + (
        gaussians.origin - camera.world_from_camera[:3, 3]
    )
    x_in_camera = offsets @ camera.world_from_camera[:3, :3]

    with np.errstate(all="ignore"):  # Gaussians behind the camera are computed and never used.
        covars, with_depth, depth_stds = project_covariances(gaussians, x_in_camera, camera)
        rgbs = colours(gaussians, gaussians.means + gaussians.origin, camera, options.sh_degree)
    nearest = np.maximum(options.near_m, options.near_sigmas * depth_stds)
    visible = np.flatnonzero(x_in_camera[:, 2] > nearest)
    order = visible[np.argsort(x_in_camera[visible, 2], kind="stable")]
    if options.clamp_colors:
        rgbs = np.maximum(0, rgbs)
    blurred = covars + options.eps2d_px2 * np.eye(2)
    opacities = 1 / (1 + np.exp(-gaussians.logit_opacities.astype(np.float64)))
    columns = np.arange(camera.width) + 0.5
    rows = np.arange(camera.height) + 0.5

    shape = (camera.height, camera.width)
    rgb, depth, alpha = np.zeros((*shape, 3)), np.zeros(shape), np.zeros(shape)
    features = np.zeros((*shape, gaussians.feature_dims))
    transmittance, ended, margin = np.ones(shape), np.zeros(shape, bool), np.full(shape, np.inf)
    max_weights = np.zeros(gaussians.size)
    pixel_counts = np.zeros(gaussians.size, np.int64)
    for i in order:
        x, y, z = x_in_camera[i]
        dx = columns[None, :] - (camera.fx * x / z + camera.cx)
        dy = rows[:, None] - (camera.fy * y / z + camera.cy)
        (a, b), (_, c) = blurred[i]
        det = a * c - b * b
        slope_x, slope_y = 0.0, 0.0
        if options.surface_depth:
            slope = np.linalg.solve(blurred[i], with_depth[i])
            reach = np.sqrt(-2 * np.log(options.alpha_min))
            if reach * np.sqrt(slope @ blurred[i] @ slope) < 0.5 * z:
                slope_x, slope_y = slope
        opacity = opacities[i]
        if options.antialias:
            opacity *= np.sqrt(max(0.0, np.linalg.det(covars[i])) / det)
        density = np.exp(-0.5 * (c * dx * dx - 2 * b * dx * dy + a * dy * dy) / det)
        alpha_i = np.minimum(0.99, opacity * density)
        blended = (opacity * density >= options.alpha_min) & ~ended
        after = transmittance * (1 - alpha_i)
        margin = np.where(
            ended, margin, np.minimum(margin, abs(opacity * density / options.alpha_min - 1))
        )
        if options.transmittance_min > 0:
            margin = np.where(
                blended, np.minimum(margin, abs(after / options.transmittance_min - 1)), margin
            )
        ended |= blended & (after < options.transmittance_min)
        blended &= ~ended
        weight = np.where(blended, alpha_i * transmittance, 0)
        transmittance = np.where(blended, after, transmittance)
        rgb += weight[..., None] * rgbs[i]
        depth += weight * (z + slope_x * dx + slope_y * dy)
        alpha += weight
        features += weight[..., None] * gaussians.features[i]
        max_weights[i] = weight.max()
        pixel_counts[i] = blended.sum()
    depth = np.divide(depth, alpha, out=np.zeros(shape), where=alpha > 0)
    rgb += (1 - alpha)[..., None] * np.array(options.background)
    # A Gaussian skipped has weight alpha_min. A pixel ends with the transmittance before the last
    # Gaussian, which is at most 100 times that behind it, as alpha is at most 0.99.
    max_flip = 2 * (options.alpha_min + min(1, 100 * options.transmittance_min))
    return Rendering(rgb, depth, alpha, features, margin, max_flip, max_weights, pixel_counts)
