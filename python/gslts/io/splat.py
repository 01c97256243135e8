"""Maps in the `.splat` format of viewers on the web (antimatter15/splat, 2023).

There is no header; each Gaussian is 32 bytes, little-endian:

- float32 x, y, z: `means` + `origin`. The format has no origin: some kilometres from the world's
  origin, centres are rounded to more than a millimetre.
- float32 scales, m.
- uint8 red, green, blue, opacity: the colour of SH degree 0. The format has neither view-dependent
  colour nor features nor ids.
- uint8 w, x, y, z of the unit quaternion, as 128 q + 128.

Gaussians are sorted by opacity times volume, largest first, so that a viewer that is still loading
shows the most important ones. The axes are those of the map, z up; many viewers expect -y up.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gslts.core.gaussian_map import SH_C0, GaussianMap
from gslts.io.activation import opacities_of, scales_of, to_bytes, unit_quats
from gslts.io.atomic_files import write_atomic

GAUSSIAN = np.dtype(
    [("mean", "<f4", 3), ("scales", "<f4", 3), ("rgba", np.uint8, 4), ("quat", np.uint8, 4)]
)
"""Layout of one Gaussian."""


def write_splat(gaussian_map: GaussianMap, path: Path) -> None:
    """Write a map without features, ids and colours beyond SH degree 0.

    Args:
        gaussian_map: Map of any dtype.
        path: File to write, atomically.

    Raises:
        OSError: The file cannot be written; an old file is unchanged.
    """
    log_scales = gaussian_map.log_scales.astype(np.float64)
    opacities = opacities_of(gaussian_map.logit_opacities)
    # The logarithm of opacity times volume, which cannot overflow.
    importance = log_scales.sum(axis=1) + np.log(np.maximum(opacities, 1e-300))
    rows = splat_rows(gaussian_map)[np.argsort(-importance, kind="stable")]
    write_atomic(path, rows.tobytes())


def splat_rows(gaussian_map: GaussianMap) -> NDArray[Any]:
    """Convert Gaussians to rows of the format.

    Args:
        gaussian_map: Map of any dtype.

    Returns:
        [N] of dtype `GAUSSIAN`, in the order of the map.
    """
    opacities = opacities_of(gaussian_map.logit_opacities)
    colors = 0.5 + SH_C0 * gaussian_map.sh[:, 0].astype(np.float64)
    rows = np.empty(gaussian_map.size, GAUSSIAN)
    rows["mean"] = gaussian_map.means + gaussian_map.origin
    rows["scales"] = scales_of(gaussian_map.log_scales)
    rows["rgba"] = to_bytes(255 * np.column_stack([colors, opacities]))
    rows["quat"] = to_bytes(128 * unit_quats(gaussian_map.quats.astype(np.float64)) + 128)
    return rows


def rounding_m(gaussian_map: GaussianMap) -> float:
    """Return the maximum rounding error of centres in this format, m.

    Args:
        gaussian_map: Map to be written.
    """
    farthest_m = np.abs(gaussian_map.means + gaussian_map.origin).max(initial=0)
    return float(np.spacing(np.float32(farthest_m)) / 2)
