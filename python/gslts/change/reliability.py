"""Whether a frame can tell anything about changes."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from gslts.core.gaussian_map import FloatArray
from gslts.types import Bools, Floats32

LEAST_DEPTH = 0.1
"""Share of the pixels in which depth must be measured."""
BLACK, WHITE = 0.03, 0.98
MOST_CLIPPED = 0.6
"""Share of the pixels that may be black or white."""
LEAST_KNOWN = 0.4
"""Share of the image that the map must fill."""
LEAST_SHARPNESS = 0.15
"""Of the edges across and down, as a share of those in the rendering: a turn smears one of them."""
ALIKE = 0.75
"""Cosine of features of one thing."""
MOST_UNLIKE = 0.25
"""Share of what the map knows where features may differ; changed objects are smaller."""
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
    if (_sharpness(photo, known) < LEAST_SHARPNESS * _sharpness(rgb, known)).any():
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


def fault_of_likeness(alike: Floats32, known: Bools) -> str | None:
    """Why a frame is not of the place that the map shows: similarities [H,W], and [H,W]."""
    unlike = float((alike[known] < ALIKE).mean())
    if unlike <= MOST_UNLIKE:
        return None
    return f"{100 * unlike:.0f} % of the picture look otherwise: pose or intrinsics are wrong"


def _sharpness(rgb: Floats32, known: Bools) -> NDArray[np.float64]:
    """(2,) across and down."""
    grey = cv2.cvtColor(np.ascontiguousarray(rgb), cv2.COLOR_RGB2GRAY)
    across = np.array([[1, -2, 1]], np.float32)
    return np.array([cv2.filter2D(grey, -1, one)[known].var() for one in (across, across.T)])
