"""How well a map shows frames that it was not made from."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from gslts.frame import RgbdFrame
from gslts.gaussian_map import FloatArray, GaussianMap
from gslts.losses import Exposure, fit_exposure, photometric_loss
from gslts.render import Rasterizer, RenderOptions


@dataclass(frozen=True)
class Quality:
    """Means over frames, with the exposure of each fitted and its pose as given.

    Attributes:
        frames: How many were compared.
        psnr_db: Of the colours.
        ssim: Structural similarity of the colours.
        depth_l1_m: Of the depth where it was measured; NaN without any.
    """

    frames: int
    psnr_db: float
    ssim: float
    depth_l1_m: float


def evaluate(gaussian_map: GaussianMap, frames: Iterable[RgbdFrame], threads: int = 0) -> Quality:
    """Renders the map where frames were taken and compares.

    Args:
        gaussian_map: float32.
        frames: At least one.
        threads: 0 means one a hardware thread.

    Raises:
        ValueError: There is no frame.
    """
    rasterizer, options = Rasterizer(np.float32), RenderOptions(threads=threads)
    psnrs_db, ssim, depth_l1_m = [], [], []
    for frame in frames:
        images = rasterizer.forward(gaussian_map, frame.camera, options)
        photo = frame.rgb.astype(np.float32) / 255
        exposure = fit_exposure(images.rgb, photo, threads=threads)
        loss = photometric_loss(images.rgb, photo, exposure=exposure, threads=threads)
        psnrs_db.append(psnr_db(exposed(images.rgb, exposure), photo))
        ssim.append(loss.ssim)
        both = (frame.depth > 0) & (images.depth > 0)
        if both.any():
            depth_l1_m.append(np.abs(images.depth - frame.depth)[both].mean())
    if not psnrs_db:
        raise ValueError("evaluate: there is no frame")
    return Quality(
        frames=len(psnrs_db),
        psnr_db=float(np.mean(psnrs_db)),
        ssim=float(np.mean(ssim)),
        depth_l1_m=float(np.mean(depth_l1_m)) if depth_l1_m else float("nan"),
    )


def exposed(rgb: FloatArray, exposure: Exposure) -> FloatArray:
    """[H,W,3] rendered colours as a photograph of that exposure shows them, of the same dtype."""
    gain, offset = (np.array(one, np.float32) for one in (exposure.gain, exposure.offset))
    result: FloatArray = gain * rgb + offset
    return result


def psnr_db(rgb: FloatArray, photo: FloatArray) -> float:
    """Peak signal-to-noise ratio of [H,W,3] colours, clipped to 0 to 1; at most 100 dB."""
    error = float(np.mean((rgb.clip(0, 1) - photo) ** 2, dtype=np.float64))
    return float(-10 * np.log10(max(error, 1e-10)))
