"""Exposures of the training frames against the colours of the map."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gslts.core.gaussian_map import SH_C0, FloatArray, GaussianMap
from gslts.localization.alignment import solve_positive
from gslts.mapping.observation import Observation
from gslts.rendering.losses import Exposure, fit_exposure
from gslts.types import Bools, Floats32

GAIN_RANGE = (0.3, 3.0)
"""Gains that a camera's automatic exposure can have between two frames of one recording."""
MAX_OFFSET = 0.5
"""Maximum absolute offset of an exposure, of colours from 0 to 1."""
GAIN_STD, OFFSET_STD = 0.3, 0.03
"""Standard deviations of gains about 1 and of offsets about 0: exposure and white balance scale
colours, and hardly shift them."""
MEAN_ERROR_STD = 0.01
"""Standard deviation of the mean error of a rendering, of colours from 0 to 1: that of errors of
0.05 in 25 independent parts. It weighs the prior against the images."""
MOMENT_PIXELS = (slice(None, None, 4), slice(None, None, 4))
"""Pixels whose moments weigh the images: all would take 20 ms at 640 x 480 instead of 1 ms."""


def refit_exposure(
    observation: Observation,
    rendered_rgb: FloatArray,
    observed_rgb: Floats32,
    mask: Bools | None,
    threads: int = 0,
) -> None:
    """Fit the exposure of a frame again; keep the last one if the new one is not plausible.

    Args:
        observation: Training frame; its exposure is changed in place.
        rendered_rgb: [H,W,3] colours of the map.
        observed_rgb: [H,W,3] colours of the frame.
        mask: [H,W] pixels that count; None means all.
        threads: Number of threads; 0 means one per hardware thread.
    """
    exposure = fit_likely_exposure(rendered_rgb, observed_rgb, mask, threads)
    observation.exposure_rejected = not is_plausible(exposure)
    if not observation.exposure_rejected:
        observation.exposure = exposure


def fit_likely_exposure(
    rendered_rgb: FloatArray, observed_rgb: Floats32, mask: Bools | None, threads: int = 0
) -> Exposure:
    """Fit gains and offsets with a prior, by regularized least squares.

    Without the prior, gain and colours of frames that overlap little with others drift apart:
    errors of the rendering make the fitted gain too small, and contrast grows to make up for it.

    Args:
        rendered_rgb: [H,W,3] colours of the map.
        observed_rgb: [H,W,3] colours of the frame.
        mask: [H,W] pixels that count; None means all.
        threads: Number of threads; 0 means one per hardware thread.

    Returns:
        Exposure from the rendered to the observed colours.
    """
    fit = fit_exposure(rendered_rgb, observed_rgb, mask=mask, threads=threads)
    sampled = rendered_rgb[MOMENT_PIXELS]
    colors = sampled.reshape(-1, 3) if mask is None else sampled[mask[MOMENT_PIXELS]]
    if not len(colors):
        return fit
    colors = colors.astype(np.float64)
    means, squares = colors.mean(axis=0), (colors**2).mean(axis=0)
    weights = np.square(MEAN_ERROR_STD / np.array([GAIN_STD, OFFSET_STD]))
    pairs = []
    for mean, square, gain, offset in zip(means, squares, fit.gain, fit.offset, strict=True):
        right = (square * gain + mean * offset + weights[0], mean * gain + offset)
        hessian = np.array([[square + weights[0], mean], [mean, 1 + weights[1]]])
        pairs.append(solve_positive(hessian, np.array(right)))
    gains, offsets = np.transpose(pairs)
    return Exposure(gain=gains, offset=offsets)


def is_plausible(exposure: Exposure) -> bool:
    """Return whether a fitted exposure can be that of a camera.

    A fit is not plausible where the rendering shows hardly anything, as in the first steps.

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
