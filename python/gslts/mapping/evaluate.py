"""How well a map shows frames that it was not made from."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from gslts.frame import RgbdFrame
from gslts.gaussian_map import GaussianMap
from gslts.losses import fit_exposure, photometric_loss
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
    psnr_db, ssim, depth_l1_m = [], [], []
    for frame in frames:
        images = rasterizer.forward(gaussian_map, frame.camera, options)
        photo = frame.rgb.astype(np.float32) / 255
        exposure = fit_exposure(images.rgb, photo, threads=threads)
        loss = photometric_loss(images.rgb, photo, exposure=exposure, threads=threads)
        shown = np.array(exposure.gain) * images.rgb + np.array(exposure.offset)
        error = float(np.mean((shown.clip(0, 1) - photo) ** 2))
        psnr_db.append(-10 * np.log10(max(error, 1e-10)))
        ssim.append(loss.ssim)
        both = (frame.depth > 0) & (images.depth > 0)
        if both.any():
            depth_l1_m.append(np.abs(images.depth - frame.depth)[both].mean())
    if not psnr_db:
        raise ValueError("evaluate: there is no frame")
    return Quality(
        frames=len(psnr_db),
        psnr_db=float(np.mean(psnr_db)),
        ssim=float(np.mean(ssim)),
        depth_l1_m=float(np.mean(depth_l1_m)) if depth_l1_m else float("nan"),
    )
