"""Exposure of a recording against the colours of a map."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from gslts.core.gaussian_map import GaussianMap
from gslts.extension.constants import BLUR_SHARE, MIN_EXPOSURE_PIXELS
from gslts.extension.new_space import FrameSpace
from gslts.mapping.exposures import is_plausible
from gslts.mapping.observation import Observation
from gslts.rendering.losses import Exposure
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.types import Floats32


def recording_exposure(
    gaussian_map: GaussianMap,
    frames: Sequence[Observation],
    spaces: Sequence[FrameSpace],
    threads: int = 0,
) -> Exposure:
    """Estimate the mean exposure of a recording where its frames agree with the map.

    The gain is the ratio of the standard deviations of the blurred colours: a least-squares fit is
    too low, as rendered colours have errors as well.

    Args:
        gaussian_map: float32.
        frames: At their poses in the map.
        spaces: What each frame shows.
        threads: Number of threads; 0 means all.

    Returns:
        Maps rendered colours to those of the frames; the identity if too little agrees, or if it
        is not plausible.
    """
    rasterizer, options = Rasterizer(np.float32), RenderOptions(threads=threads)
    observed: list[Floats32] = []
    rendered: list[Floats32] = []
    for frame, space in zip(frames, spaces, strict=True):
        images = rasterizer.forward(gaussian_map, frame.camera(), options)
        agrees, mask = ~(space.better | space.changed), frame.mask()
        step = max(1, round(BLUR_SHARE * agrees.shape[1]))
        if mask is not None:  # What the blur mixes with other pixels is left out, too.
            agrees &= cv2.erode(mask.astype(np.uint8), np.ones((step, step)), borderValue=1) > 0
        part = (slice(step // 2, None, step),) * 2
        for image, colors in ((frame.color(), observed), (images.rgb, rendered)):
            blurred: Floats32 = cv2.blur(np.asarray(image, np.float32), (step, step))  # type: ignore[assignment]
            colors.append(blurred[part][agrees[part]])
    ours, theirs = np.concatenate(rendered), np.concatenate(observed)
    if len(ours) < MIN_EXPOSURE_PIXELS:
        return Exposure()
    gain = theirs.std(axis=0) / np.maximum(ours.std(axis=0), 1e-6)
    exposure = Exposure(gain=gain, offset=theirs.mean(axis=0) - gain * ours.mean(axis=0))
    return exposure if is_plausible(exposure) else Exposure()
