"""Conversion between the stored values of Gaussians and what other formats hold."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gslts.core.gaussian_map import FloatArray
from gslts.types import Bytes, Floats

OPAQUE_LOGIT = 20.0
"""The stored opacity that stands for 1 and, negated, for 0: its sigmoid is 1 in float32. The reader
of PLY has the same."""
FLAT_LOG_SCALE = -30.0
"""The stored scale that stands for 0: 1e-13 m, and its square is no denormal float32. The reader of
PLY has the same."""
MIN_QUAT_LENGTH = 1e-12
"""Quaternions shorter than this mean no rotation, as in the rasterizer."""


def opacities_of(logit_opacities: FloatArray) -> Floats:
    """Compute opacities, 0 to 1.

    Args:
        logit_opacities: [N] as stored.
    """
    opacities: Floats = np.exp(-np.logaddexp(0, -logit_opacities.astype(np.float64)))
    return opacities


def logits_of(opacities: FloatArray) -> Floats:
    """Compute what is stored for opacities.

    Args:
        opacities: [N], 0 to 1.

    Returns:
        [N], at most `OPAQUE_LOGIT` from 0.
    """
    with np.errstate(divide="ignore"):
        logits = np.log(opacities.astype(np.float64)) - np.log1p(-opacities.astype(np.float64))
    return np.asarray(logits.clip(-OPAQUE_LOGIT, OPAQUE_LOGIT))


def scales_of(log_scales: FloatArray) -> Floats:
    """Compute standard deviations, m.

    Args:
        log_scales: [N,3] as stored.
    """
    scales: Floats = np.exp(log_scales.astype(np.float64))
    return scales


def log_scales_of(scales: FloatArray) -> Floats:
    """Compute what is stored for standard deviations.

    Args:
        scales: [N,3], m, 0 or more.

    Returns:
        [N,3], at least `FLAT_LOG_SCALE`.
    """
    return np.asarray(np.log(np.maximum(scales.astype(np.float64), np.exp(FLAT_LOG_SCALE))))


def unit_quats(quats: FloatArray) -> FloatArray:
    """Normalize quaternions, in their dtype.

    Args:
        quats: [N,4] wxyz; one of length 0 means no rotation.
    """
    lengths = np.linalg.norm(quats, axis=1, keepdims=True)
    rotated = lengths > MIN_QUAT_LENGTH
    identity = np.array([1, 0, 0, 0], quats.dtype)
    return np.where(rotated, quats / np.where(rotated, lengths, 1), identity)


def to_bytes(values: NDArray[Any]) -> Bytes:
    """Round to 8-bit values; what lies beyond 0 to 255 becomes 0 or 255.

    Args:
        values: Any shape.
    """
    return np.asarray(np.rint(values).clip(0, 255), np.uint8)
