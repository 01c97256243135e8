"""Rotation, uniform scaling and translation of Gaussians."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gslts.core.gaussian_map import FloatArray, GaussianMap
from gslts.core.se3 import product, quats_of_rotations
from gslts.core.spherical_harmonics import rotate_harmonics
from gslts.types import Floats

MAX_SHEAR = 1e-5
"""Maximum deviation of the axes of a transform from equal lengths and right angles, relative: what
remains of a rotation that was stored in float32."""


def split_similarity(linear: Floats) -> tuple[float, Floats]:
    """Split a linear map into a uniform scale and a rotation.

    Args:
        linear: [3,3].

    Returns:
        The scale, positive, and the rotation [3,3].

    Raises:
        ValueError: It mirrors, shears or scales unevenly, or a number is not finite.
    """
    with np.errstate(all="ignore"):
        determinant = float(np.linalg.det(linear))
    if not 0 < determinant < np.inf:
        raise ValueError(f"expected a rotation with a positive scale, got {linear.tolist()}")
    scale = float(np.cbrt(determinant))
    rotation: Floats = linear / scale
    if np.abs(product(rotation.T, rotation) - np.eye(3)).max() > MAX_SHEAR:
        raise ValueError(f"expected one scale for all axes and no shear, got {linear.tolist()}")
    return scale, rotation


def transform_map(gaussian_map: GaussianMap, b_from_a: Floats) -> GaussianMap:
    """Transform a map; without a rotation or scale only its origin changes.

    Args:
        gaussian_map: In frame a; any dtype.
        b_from_a: [4,4] rotation, uniform scale and translation.

    Returns:
        The map in frame b, of the same dtype.

    Raises:
        ValueError: The transform mirrors, shears or scales unevenly, or a centre exceeds the dtype.
    """
    linear = b_from_a[:3, :3]
    origin = product(linear, gaussian_map.origin[:, None])[:, 0] + b_from_a[:3, 3]
    if np.array_equal(linear, np.eye(3)):
        return replace(gaussian_map, origin=origin)
    scale, rotation = split_similarity(linear)
    with np.errstate(over="ignore"):  # The map rejects numbers that are not finite.
        means = (gaussian_map.means[:, None] * linear).sum(axis=2).astype(gaussian_map.dtype)
    return replace(
        gaussian_map,
        means=means,
        quats=rotate_quats(gaussian_map.quats, rotation).astype(gaussian_map.dtype),
        log_scales=(gaussian_map.log_scales + np.log(scale)).astype(gaussian_map.dtype),
        sh=rotate_harmonics(gaussian_map.sh, rotation),
        origin=origin,
    )


def rotate_quats(quats: FloatArray, rotation: Floats) -> Floats:
    """Rotate quaternions with the world.

    Args:
        quats: [N,4] wxyz, of any length.
        rotation: [3,3].

    Returns:
        [N,4] wxyz, of the same lengths.
    """
    w, x, y, z = quats.astype(np.float64).T
    a, b, c, d = quats_of_rotations(rotation[None])[0]
    return np.column_stack(
        [
            a * w - b * x - c * y - d * z,
            a * x + b * w + c * z - d * y,
            a * y - b * z + c * w + d * x,
            a * z + b * y - c * x + d * w,
        ]
    )
