"""Exposure and white balance between a frame and a map, whatever else differs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gslts.core.gaussian_map import FloatArray
from gslts.rendering.losses import Exposure, fit_exposure
from gslts.types import Floats32

ROUNDS = 2
OUTLYING = 2.5
"""Pixels whose error is so many times the median are left out in the next round."""
LEAST_ERROR = 0.02
"""Of a colour; smaller ones are never outlying."""


def robust_exposure(
    rgb: FloatArray, photo: Floats32, known: NDArray[np.bool_], threads: int = 0
) -> Exposure:
    """From the map's colours to those of the frame, fitted to what did not change.

    Args:
        rgb: [H,W,3] rendered.
        photo: [H,W,3] sRGB, 0 to 1.
        known: [H,W] where both show something.
        threads: 0 means one a hardware thread.
    """
    mask = known & (photo < 1).all(axis=-1)
    exposure = fit_exposure(rgb, photo, mask=mask, threads=threads)
    for _ in range(ROUNDS):
        gain, offset = (np.array(one, np.float32) for one in (exposure.gain, exposure.offset))
        errors = np.abs(gain * rgb + offset - photo).max(axis=-1)
        if not mask.any():
            break
        limit = OUTLYING * max(LEAST_ERROR, float(np.median(errors[mask])))
        exposure = fit_exposure(rgb, photo, mask=mask & (errors < limit), threads=threads)
    return exposure
