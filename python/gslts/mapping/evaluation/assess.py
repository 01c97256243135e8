"""What else there is to say about a map: how it looks to people, and how long a rendering takes."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.rendering.losses import apply_exposure, fit_exposure
from gslts.rendering.metrics import Lpips
from gslts.rendering.rasterizer import Rasterizer, RenderOptions


@dataclass(frozen=True)
class Assessment:
    """Over all frames, with the exposure of each fitted and its pose as given.

    Attributes:
        render_ms: Median time of a rendering, without gradients, on this machine.
        lpips: Mean; None if no weights were given. Its features reach across many pixels, so that
            none can be left out: where a frame's mask is False, the rendering takes the colours of
            the photograph, and both are the same there.
    """

    render_ms: float
    lpips: float | None


def assess(
    gaussian_map: GaussianMap,
    frames: Iterable[RgbdFrame],
    lpips: Lpips | None = None,
    threads: int = 0,
) -> Assessment:
    """Renders the map where frames were taken.

    Args:
        gaussian_map: float32.
        frames: At least one.
        lpips: The weights.
        threads: Of the rendering; 0 means one a hardware thread.

    Raises:
        ValueError: There is no frame, or it is too small for LPIPS.
    """
    rasterizer, options = Rasterizer(np.float32), RenderOptions(threads=threads)
    times_s, distances = [], []
    for number, frame in enumerate(frames):
        if number == 0:
            rasterizer.forward(gaussian_map, frame.camera, options)  # Takes the memory.
        start = time.perf_counter()
        images = rasterizer.forward(gaussian_map, frame.camera, options)
        times_s.append(time.perf_counter() - start)
        if lpips is not None:
            photo = frame.rgb.astype(np.float32) / 255
            exposure = fit_exposure(images.rgb, photo, mask=frame.mask, threads=threads)
            shown = apply_exposure(images.rgb, exposure)
            if frame.mask is not None:
                shown[~frame.mask] = photo[~frame.mask]
            distances.append(lpips.distance(shown, photo))
    if not times_s:
        raise ValueError("assess: there is no frame")
    return Assessment(
        render_ms=1e3 * float(np.median(times_s)),
        lpips=float(np.mean(distances)) if distances else None,
    )
