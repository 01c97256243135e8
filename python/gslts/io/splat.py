"""Maps in the `.splat` format that viewers on the web read (antimatter15/splat, 2023).

There is no header; each Gaussian is 32 bytes, little-endian:

- float32 x, y, z: `means` + `origin`. The format has no origin: far from the world's origin, from
  some kilometres on, centres are rounded to more than a millimetre.
- float32 scales, m.
- uint8 red, green, blue, opacity: the colour of SH degree 0; what depends on the direction of view
  has no place in the format and is left out, as are features and ids.
- uint8 w, x, y, z of the unit quaternion, as 128 q + 128.

Gaussians come in falling order of opacity times volume, so that a viewer that is still loading
shows the most important ones. Axes stay as they are: z up, where many viewers take -y for up.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gslts.core.gaussian_map import SH_C0, GaussianMap
from gslts.io.atomic_files import write_whole

GAUSSIAN = np.dtype(
    [("mean", "<f4", 3), ("scales", "<f4", 3), ("rgba", np.uint8, 4), ("quat", np.uint8, 4)]
)
SHORTEST_QUAT = 1e-12
"""Shorter quaternions mean no rotation, as in the rasterizer."""


def write_splat(gaussian_map: GaussianMap, path: Path) -> None:
    """Writes a map, without its colours beyond SH degree 0, features and ids.

    Raises:
        OSError: The file cannot be written; what was there stays.
    """
    opacities = _sigmoid(gaussian_map.logit_opacities.astype(np.float64))
    log_scales = gaussian_map.log_scales.astype(np.float64)
    colors = 0.5 + SH_C0 * gaussian_map.sh[:, 0].astype(np.float64)
    rows = np.empty(gaussian_map.size, GAUSSIAN)
    rows["mean"] = gaussian_map.means + gaussian_map.origin
    rows["scales"] = np.exp(log_scales)
    rows["rgba"] = _bytes(255 * np.column_stack([colors, opacities]))
    rows["quat"] = _bytes(128 * _unit(gaussian_map.quats.astype(np.float64)) + 128)
    # The logarithm of opacity times volume, which cannot overflow.
    importance = log_scales.sum(axis=1) + np.log(np.maximum(opacities, 1e-300))
    write_whole(path, rows[np.argsort(-importance, kind="stable")].tobytes())


def rounding_m(gaussian_map: GaussianMap) -> float:
    """By how much centres are rounded in the format, at most, m."""
    farthest_m = np.abs(gaussian_map.means + gaussian_map.origin).max(initial=0)
    return float(np.spacing(np.float32(farthest_m)) / 2)


def _unit(quats: NDArray[np.float64]) -> NDArray[np.float64]:
    lengths = np.linalg.norm(quats, axis=1, keepdims=True)
    rotated = lengths > SHORTEST_QUAT
    return np.where(rotated, quats / np.where(rotated, lengths, 1), [1.0, 0, 0, 0])


def _sigmoid(logits: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.exp(-np.logaddexp(0, -logits))


def _bytes(values: NDArray[np.float64]) -> NDArray[np.uint8]:
    return np.rint(values).clip(0, 255).astype(np.uint8)
