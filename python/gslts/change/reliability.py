"""Whether a frame can tell anything about changes."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from gslts.gaussian_map import FloatArray

Floats32 = NDArray[np.float32]
Bools = NDArray[np.bool_]

LEAST_DEPTH = 0.1
"""Share of the pixels in which depth must be measured."""
BLACK, WHITE = 0.03, 0.98
MOST_CLIPPED = 0.6
"""Share of the pixels that may be black or white."""
LEAST_KNOWN = 0.4
"""Share of the image that the map must fill."""
LEAST_SHARPNESS = 0.15
"""Of the edges, as a share of those in the rendering."""
MOST_CHANGED = 0.4
"""Share of what the map knows; when more differs, something else is wrong."""
LEAST_AGREEING = 0.5
"""Share of the measured depths that must be the map's, or farther or nearer by an object."""
AGREEING = 0.06
"""Relative difference of depths on one surface."""
MOST_SHIFT_M, MOST_TURN_RAD = 0.25, 0.15
"""By which a pose may have to be corrected."""


def fault_of_frame(photo: Floats32, measured: Floats32) -> str | None:
    """Why a frame alone tells nothing: [H,W,3] sRGB, 0 to 1, and [H,W] m."""
    if (measured > 0).mean() < LEAST_DEPTH:
        return f"depth is measured in {100 * (measured > 0).mean():.0f} % of the pixels"
    if (photo.max(axis=-1) < BLACK).mean() > MOST_CLIPPED:
        return "the picture is black"
    if (photo.min(axis=-1) > WHITE).mean() > MOST_CLIPPED:
        return "the picture is saturated"
    return None


def fault_of_view(
    photo: Floats32, rgb: Floats32, measured: Floats32, rendered: FloatArray, known: Bools
) -> str | None:
    """Why a frame and a map cannot be compared: pictures [H,W,3], depths [H,W] m, [H,W]."""
    if known.mean() < LEAST_KNOWN:
        return f"the map fills {100 * known.mean():.0f} % of the view"
    of_photo, of_map = _sharpness(photo, known), _sharpness(rgb, known)
    if of_photo < LEAST_SHARPNESS * of_map:
        return "the picture is blurred"
    both = known & (measured > 0) & (rendered > 0)
    if not both.any():
        return "depth is measured nowhere in the map"
    agreeing = np.abs(measured - rendered)[both] < AGREEING * rendered[both]
    if agreeing.mean() < LEAST_AGREEING:
        return (
            f"depths agree in {100 * agreeing.mean():.0f} % of the pixels: pose or intrinsics are "
            "wrong"
        )
    return None


def _sharpness(rgb: Floats32, known: Bools) -> float:
    grey = cv2.cvtColor(np.ascontiguousarray(rgb), cv2.COLOR_RGB2GRAY)
    return float(cv2.Laplacian(grey, cv2.CV_32F)[known].var())
