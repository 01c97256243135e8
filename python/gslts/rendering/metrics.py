"""Image metrics: PSNR, SSIM and LPIPS of a rendering against a photograph."""

from __future__ import annotations

import numpy as np

from gslts.core.gaussian_map import FloatArray
from gslts.rendering.losses import Exposure, photometric_loss
from gslts.rendering.lpips import MIN_SIDE_PX, Lpips
from gslts.types import Bools

__all__ = ["MIN_SIDE_PX", "Lpips", "psnr_db", "psnr_from_mse_db", "ssim"]

MAX_PSNR_DB = 100.0
"""PSNR of equal images, dB. Finite, so that means over images stay finite."""


def psnr_db(rgb: FloatArray, target: FloatArray, mask: Bools | None = None) -> float:
    """Compute the peak signal-to-noise ratio for a peak of 1.

    Args:
        rgb: [H,W,3] colours, clipped to 0 to 1.
        target: [H,W,3] colours, 0 to 1.
        mask: [H,W] pixels to compare; None means all.

    Returns:
        dB, at most `MAX_PSNR_DB`; NaN for an empty mask.
    """
    if mask is not None and not mask.any():
        return float("nan")
    squares = (rgb.clip(0, 1) - target) ** 2
    return psnr_from_mse_db(
        float(np.mean(squares if mask is None else squares[mask], dtype=np.float64))
    )


def psnr_from_mse_db(mse: float, max_db: float = MAX_PSNR_DB) -> float:
    """Compute the peak signal-to-noise ratio of a mean squared error for a peak of 1.

    Args:
        mse: Mean squared error, at least 0.
        max_db: Greatest result, dB, such as that of an error of 0.
    """
    return min(max_db, -10 * float(np.log10(mse))) if mse > 0 else max_db


def ssim(
    rgb: FloatArray,
    target: FloatArray,
    mask: Bools | None = None,
    *,
    exposure: Exposure | None = None,
    threads: int = 0,
) -> float:
    """Compute the mean structural similarity (Wang et al. 2004); see `photometric_loss`.

    Args:
        rgb: [H,W,3] colours.
        target: [H,W,3] colours, 0 to 1, of the same dtype.
        mask: [H,W] pixels to compare; None means all.
        exposure: Applied to `rgb` first.
        threads: Number of threads; 0 means all.

    Raises:
        ValueError: An array has the wrong shape or dtype, or a number is not finite.
    """
    return photometric_loss(rgb, target, mask=mask, exposure=exposure, threads=threads).ssim
