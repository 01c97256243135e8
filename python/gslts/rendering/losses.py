"""Losses of a rendered image against a measured one, with their gradients.

Each is a mean over the compared pixels, so that a mask changes which pixels are compared and not
the weight of the loss; without any, value and gradient are 0. Arrays are float32 or float64, all of
one dtype; results are bit-identical for any number of threads.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from gslts._core import optim as _core
from gslts._core.optim import Exposure
from gslts.core.gaussian_map import FloatArray
from gslts.types import Bools

__all__ = [
    "DepthLoss",
    "Exposure",
    "PhotometricLoss",
    "apply_exposure",
    "depth_loss",
    "fit_exposure",
    "photometric_loss",
]


@dataclass(frozen=True, eq=False)
class PhotometricLoss:
    """Colour loss of one image, as `photometric_loss` returns it.

    Attributes:
        value: (1 - lambda) l1 + lambda (1 - ssim).
        l1: Mean absolute difference.
        ssim: Mean structural similarity.
        dL_drgb: [H,W,3] gradient of value; zero outside the mask.
    """

    value: float
    l1: float
    ssim: float
    dL_drgb: FloatArray


@dataclass(frozen=True, eq=False)
class DepthLoss:
    """Depth loss of one image, as `depth_loss` returns it.

    Attributes:
        value: Mean `|rendered - measured|`, m; if relative, divided by measured.
        count: Number of compared pixels.
        dL_ddepth: [H,W] gradient of value.
    """

    value: float
    count: int
    dL_ddepth: FloatArray


def _of_dtype(name: str, function: str, array: FloatArray) -> Any:
    suffix = {"float32": "_float", "float64": "_double"}.get(array.dtype.name)
    if suffix is None:
        raise ValueError(f"{function}: {name}: expected float32 or float64, got {array.dtype}")
    return getattr(_core, function + suffix)


def apply_exposure(rgb: FloatArray, exposure: Exposure) -> FloatArray:
    """Apply gain and offset of each channel to colours.

    Args:
        rgb: [...,3] rendered colours.
        exposure: Exposure of a photograph against the rendering.

    Returns:
        [...,3] of the same dtype, not clipped.
    """
    gain, offset = (np.array(part, np.float32) for part in (exposure.gain, exposure.offset))
    result: FloatArray = gain * rgb + offset
    return result


def photometric_loss(
    rgb: FloatArray,
    target: FloatArray,
    *,
    mask: Bools | None = None,
    dssim_weight: float = 0.2,
    exposure: Exposure | None = None,
    threads: int = 0,
) -> PhotometricLoss:
    """Compute the colour loss of 3DGS: L1 and SSIM (Kerbl et al. 2023, eq. 7).

    SSIM (Wang et al. 2004) is taken channel by channel with a Gaussian window of 11 x 11 pixels and
    sigma 1.5, C1 = 0.01^2 and C2 = 0.03^2. The window counts pixels of the mask only, with weights
    scaled to sum 1: neither the border of the image nor that of a mask enters as black pixels, and
    an image may be smaller than the window.

    Args:
        rgb: [H,W,3] rendered colours.
        target: [H,W,3] measured colours, 0 to 1.
        mask: [H,W] pixels to compare; None means all.
        dssim_weight: lambda, in [0, 1].
        exposure: Applied to `rgb` first; the gradient treats it as a constant.
        threads: Number of threads; 0 means all.

    Raises:
        ValueError: An array has the wrong shape or dtype, a number inside the mask is not finite,
            or dssim_weight is out of range.
    """
    function = _of_dtype("rgb", "photometric_loss", rgb)
    return PhotometricLoss(
        *function(
            rgb,
            target,
            mask=mask,
            dssim_weight=dssim_weight,
            exposure=Exposure() if exposure is None else exposure,
            threads=threads,
        )
    )


def fit_exposure(
    rgb: FloatArray,
    target: FloatArray,
    *,
    mask: Bools | None = None,
    threads: int = 0,
) -> Exposure:
    """Fit target = gain * rgb + offset per channel by least squares, in closed form.

    Args:
        rgb: [H,W,3] rendered colours; a constant channel gets gain 1.
        target: [H,W,3] measured colours.
        mask: [H,W] pixels to compare; None means all.
        threads: Number of threads; 0 means all.

    Raises:
        ValueError: An array has the wrong shape or dtype, or a number inside the mask is not
            finite.
    """
    function = _of_dtype("rgb", "fit_exposure", rgb)
    exposure: Exposure = function(rgb, target, mask=mask, threads=threads)
    return exposure


def depth_loss(
    depth: FloatArray,
    target: FloatArray,
    *,
    mask: Bools | None = None,
    relative: bool = False,
    threads: int = 0,
) -> DepthLoss:
    """Compute the L1 loss of the expected depth.

    A pixel counts if it is inside the mask, measured (target >= 1e-30; less and NaN mean no
    measurement) and rendered (depth > 0).

    Args:
        depth: [H,W] rendered depth, z in the camera frame, m.
        target: [H,W] measured depth, m.
        mask: [H,W] pixels to compare; None means all.
        relative: Whether each difference is divided by the measured depth.
        threads: Number of threads; 0 means all.

    Raises:
        ValueError: An array has the wrong shape or dtype, or `depth` is negative or not finite.
    """
    function = _of_dtype("depth", "depth_loss", depth)
    return DepthLoss(*function(depth, target, mask=mask, relative=relative, threads=threads))
