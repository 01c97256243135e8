"""Rendering time of a map, and LPIPS of its renderings."""

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
class RenderingQuality:
    """Rendering time and LPIPS over all frames, with the exposure of each fitted.

    Attributes:
        render_ms: Median time of a rendering without gradients on this machine, ms.
        lpips: Mean LPIPS; None without weights. Its features reach across many pixels, so pixels
            outside a frame's mask cannot be left out: there the rendering takes the colours of the
            photograph.
    """

    render_ms: float
    lpips: float | None


def evaluate_rendering(
    gaussian_map: GaussianMap,
    frames: Iterable[RgbdFrame],
    lpips: Lpips | None = None,
    threads: int = 0,
) -> RenderingQuality:
    """Render a map at the poses of frames, measure the time and compute LPIPS.

    Args:
        gaussian_map: float32.
        frames: At least one.
        lpips: LPIPS with its weights; None leaves LPIPS out.
        threads: Number of threads; 0 means all.

    Raises:
        ValueError: There is no frame, or a frame is too small for LPIPS.
    """
    rasterizer, options = Rasterizer(np.float32), RenderOptions(threads=threads)
    times_s, distances = [], []
    for number, frame in enumerate(frames):
        if number == 0:
            rasterizer.forward(gaussian_map, frame.camera, options)  # Allocates the memory.
        start = time.perf_counter()
        images = rasterizer.forward(gaussian_map, frame.camera, options)
        times_s.append(time.perf_counter() - start)
        if lpips is not None:
            photo = frame.rgb.astype(np.float32) / 255
            exposure = fit_exposure(images.rgb, photo, mask=frame.mask, threads=threads)
            rendered = apply_exposure(images.rgb, exposure)
            if frame.mask is not None:
                rendered[~frame.mask] = photo[~frame.mask]
            distances.append(lpips.distance(rendered, photo))
    if not times_s:
        raise ValueError("evaluate_rendering: there is no frame")
    return RenderingQuality(
        render_ms=1e3 * float(np.median(times_s)),
        lpips=float(np.mean(distances)) if distances else None,
    )
