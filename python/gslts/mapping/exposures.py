"""Exposures of the training frames against the colours of the map."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gslts.core.gaussian_map import SH_C0, GaussianMap
from gslts.mapping.observation import Observation
from gslts.rendering.losses import Exposure
from gslts.types import Bools

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
    gaussian_map: GaussianMap,
    observations: Sequence[Observation],
    fixed: Bools,
    mean: Exposure,
) -> GaussianMap:
    """Give the frames a mean exposure by changing the colours of the map.

    Without this, exposures and colours drift together, as nothing else fixes their product. Frames
    that show enough of the fixed Gaussians do not count: these determine their exposure.

    Args:
        gaussian_map: Map whose colours the exposures refer to.
        observations: All training frames; their exposures are changed in place.
        fixed: [N] Gaussians that keep their colours.
        mean: The mean exposure.

    Returns:
        The map with new colours.
    """
    loose = [frame for frame in observations if not frame.shows_known]
    if not loose:
        return gaussian_map
    gains = np.array([frame.exposure.gain for frame in loose])
    offsets = np.array([frame.exposure.offset for frame in loose])
    gain = gains.mean(axis=0) / mean.gain
    offset = (offsets.mean(axis=0) - mean.offset) / mean.gain
    sh = gaussian_map.sh.copy()
    sh[~fixed] *= gain.astype(np.float32)
    sh[~fixed, 0] += ((0.5 * gain + offset - 0.5) / SH_C0).astype(np.float32)
    for frame, frame_gain, frame_offset in zip(loose, gains, offsets, strict=True):
        ratio = frame_gain / gain
        frame.exposure = Exposure(gain=ratio, offset=frame_offset - ratio * offset)
    return replace(gaussian_map, sh=sh)
