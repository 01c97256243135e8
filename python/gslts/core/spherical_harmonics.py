"""Spherical harmonics of Gaussians: colours that depend on the direction."""

from __future__ import annotations

import numpy as np

from gslts.core.gaussian_map import SH_C0, FloatArray
from gslts.core.se3 import product
from gslts.types import Floats

MAX_DEGREE = 3
"""Maximum degree of harmonics in a map."""
MIN_FACTOR = 1e-12
"""Factors below this in the rotation of harmonics are rounding errors of zero."""


def rotate_harmonics(sh: FloatArray, rotation: Floats) -> FloatArray:
    """Rotate colours with the Gaussians that have them.

    Args:
        sh: [N,K,3] coefficients, K = (degree + 1)^2.
        rotation: [3,3].

    Returns:
        [N,K,3] coefficients: their colour in the direction R d is that of `sh` in d.
    """
    directions, weights = _quadrature()
    before, after = _basis(directions), _basis(product(directions, rotation.T))
    result = sh.copy()
    for degree in range(1, MAX_DEGREE + 1):
        own = slice(degree**2, (degree + 1) ** 2)
        if own.stop > sh.shape[1]:
            break
        # Harmonics of one degree are orthogonal and of one norm.
        turn = product(after[:, own].T * weights, before[:, own])
        turn /= (weights * before[:, own.start] ** 2).sum()
        for row, factors in enumerate(turn, start=own.start):
            # Turns by 90 degrees, as between axes of formats, leave few.
            used = np.flatnonzero(np.abs(factors) > MIN_FACTOR)
            result[:, row] = sum(factors[k] * sh[:, own.start + k] for k in used)
    return result


def colors_in_directions(sh: FloatArray, directions: FloatArray) -> FloatArray:
    """Compute the colours of Gaussians as the rasterizer does.

    Args:
        sh: [N,K,3] coefficients, K = (degree + 1)^2.
        directions: [N,3] from the camera to the centres, of any length but 0.

    Returns:
        [N,3] colours, at least 0.
    """
    colors: FloatArray = 0.5 + SH_C0 * sh[:, 0]
    if sh.shape[1] > 1:
        units = directions / np.linalg.norm(directions, axis=1, keepdims=True)
        degrees = np.sqrt(np.arange(sh.shape[1])).astype(np.intp)
        basis = (SH_C0 * np.sqrt(2 * degrees + 1)) * _basis(units)[:, : sh.shape[1]]
        colors = colors + (basis[:, 1:, None] * sh[:, 1:]).sum(axis=1)
    return np.maximum(colors, 0)


def _quadrature() -> tuple[Floats, Floats]:
    """Return [D,3] directions and [D] weights that integrate products of two harmonics exactly."""
    heights, weights = np.polynomial.legendre.leggauss(MAX_DEGREE + 1)
    angles = 2 * np.pi * np.arange(2 * MAX_DEGREE + 1) / (2 * MAX_DEGREE + 1)
    z, angle = (part.ravel() for part in np.meshgrid(heights, angles, indexing="ij"))
    radius = np.sqrt(1 - z**2)
    directions = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), z])
    return directions, weights.repeat(len(angles))


def _basis(directions: Floats) -> Floats:
    """Return [D,16] harmonics of directions [D,3], up to a factor per degree.

    Source: 3DGS, Kerbl et al. 2023; the signs and the order are theirs.
    """
    x, y, z = directions.T
    columns = [np.ones_like(x), -y, z, -x]
    root = np.sqrt(3)
    columns += [
        root * x * y,
        -root * y * z,
        (2 * z * z - x * x - y * y) / 2,
        -root * x * z,
        root / 2 * (x * x - y * y),
    ]
    columns += [
        -np.sqrt(10) / 4 * y * (3 * x * x - y * y),
        np.sqrt(15) * x * y * z,
        -np.sqrt(6) / 4 * y * (4 * z * z - x * x - y * y),
        0.5 * z * (2 * z * z - 3 * x * x - 3 * y * y),
        -np.sqrt(6) / 4 * x * (4 * z * z - x * x - y * y),
        np.sqrt(15) / 2 * z * (x * x - y * y),
        -np.sqrt(10) / 4 * x * (x * x - 3 * y * y),
    ]
    return np.column_stack(columns)
