"""Exposures of the training frames against the colours of the map."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gslts.core.gaussian_map import SH_C0, GaussianMap
from gslts.mapping.observation import Observation
from gslts.rendering.losses import Exposure

GAIN_RANGE = (0.3, 3.0)
"""Gains that a camera's automatic exposure can have between two frames of one recording."""
MAX_OFFSET = 0.5
"""Maximum absolute offset of an exposure, of colours from 0 to 1."""


def is_plausible(exposure: Exposure) -> bool:
    """Return whether a fitted exposure can be that of a camera.

    A fit is not plausible where the rendering has hardly any contrast, such as of a plain wall or
    in the first steps: then gain and offset are not determined.

    Args:
        exposure: Fitted gain and offset of each channel.
    """
    gain, offset = np.array(exposure.gain), np.array(exposure.offset)
    low, high = GAIN_RANGE
    return bool(((gain > low) & (gain < high) & (np.abs(offset) < MAX_OFFSET)).all())


def fold_mean_exposure(
    gaussian_map: GaussianMap, observations: Sequence[Observation]
) -> GaussianMap:
    """Apply the mean exposure to the colours of the map, and divide all exposures by it.

    Without this, exposures and colours drift together, as nothing else fixes their product.

    Args:
        gaussian_map: Map whose colours the exposures refer to.
        observations: All training frames; their exposures are changed in place.

    Returns:
        The map with new colours.
    """
    gains = np.array([frame.exposure.gain for frame in observations])
    offsets = np.array([frame.exposure.offset for frame in observations])
    gain, offset = gains.mean(axis=0), offsets.mean(axis=0)
    sh = gaussian_map.sh * gain.astype(np.float32)
    sh[:, 0] += ((0.5 * gain + offset - 0.5) / SH_C0).astype(np.float32)
    for frame, frame_gain, frame_offset in zip(observations, gains, offsets, strict=True):
        ratio = frame_gain / gain
        frame.exposure = Exposure(gain=ratio, offset=frame_offset - ratio * offset)
    return replace(gaussian_map, sh=sh)
