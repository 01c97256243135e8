"""Exposures of the training frames against the colours of the map."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gslts.core.gaussian_map import SH_C0, GaussianMap
from gslts.mapping.observation import Observation
from gslts.rendering.losses import Exposure
from gslts.types import Bools, Floats

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
) -> GaussianMap:
    """Apply the mean exposure to the colours of the map, and divide all exposures by it.

    Without this, exposures and colours drift together, as nothing else fixes their product. Where
    some Gaussians are fixed, the frames that show enough of them determine the mean exposure of the
    recording; the free ones get the colours with which the other frames have it, too.

    Args:
        gaussian_map: Map whose colours the exposures refer to.
        observations: All training frames; their exposures are changed in place.
        fixed: [N] Gaussians that keep their colours.

    Returns:
        The map with new colours.
    """
    loose = [frame for frame in observations if frame.shows_known is False]
    if not loose:
        return gaussian_map
    gain, offset = _mean_exposure(loose)
    known = [frame for frame in observations if frame.shows_known]
    if known:
        known_gain, known_offset = _mean_exposure(known)
        gain, offset = gain / known_gain, (offset - known_offset) / known_gain
    sh = gaussian_map.sh.copy()
    sh[~fixed] *= gain.astype(np.float32)
    sh[~fixed, 0] += ((0.5 * gain + offset - 0.5) / SH_C0).astype(np.float32)
    for frame in loose:
        ratio = np.array(frame.exposure.gain) / gain
        frame.exposure = Exposure(
            gain=ratio.tolist(), offset=(frame.exposure.offset - ratio * offset).tolist()
        )
    return replace(gaussian_map, sh=sh)


def _mean_exposure(frames: Sequence[Observation]) -> tuple[Floats, Floats]:
    """Return the mean gain (3,) and offset (3,)."""
    gains = np.array([frame.exposure.gain for frame in frames])
    offsets = np.array([frame.exposure.offset for frame in frames])
    return gains.mean(axis=0), offsets.mean(axis=0)
