"""Exposure between a map and a frame in which something may have changed."""

from __future__ import annotations

import numpy as np

from gslts.change.constants import EXPOSURE_REFITS, MIN_OUTLIER_ERROR, OUTLIER_FACTOR
from gslts.core.gaussian_map import FloatArray
from gslts.rendering.losses import Exposure, fit_exposure
from gslts.types import Bools, Floats32


def robust_exposure(
    rendered_rgb: FloatArray, observed_rgb: Floats32, known: Bools, threads: int = 0
) -> Exposure:
    """Fit the exposure of a frame to the pixels that did not change.

    Pixels with large errors are left out and the exposure is fitted again.

    Args:
        rendered_rgb: [H,W,3] colours of the map, sRGB.
        observed_rgb: [H,W,3] colours of the frame, sRGB, 0 to 1; white pixels are left out.
        known: [H,W] pixels where both images are valid.
        threads: Number of threads; 0 means one per hardware thread.

    Returns:
        Gain and offset of each channel from the rendered to the observed colours.
    """
    mask = known & (observed_rgb < 1).all(axis=-1)
    exposure = fit_exposure(rendered_rgb, observed_rgb, mask=mask, threads=threads)
    if not mask.any():
        return exposure
    for _ in range(EXPOSURE_REFITS):
        gain = np.array(exposure.gain, np.float32)
        offset = np.array(exposure.offset, np.float32)
        errors = np.abs(gain * rendered_rgb + offset - observed_rgb).max(axis=-1)
        limit = OUTLIER_FACTOR * max(MIN_OUTLIER_ERROR, float(np.median(errors[mask])))
        inliers = mask & (errors < limit)
        exposure = fit_exposure(rendered_rgb, observed_rgb, mask=inliers, threads=threads)
    return exposure
