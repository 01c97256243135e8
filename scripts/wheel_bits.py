"""Check that kernels give the bits recorded on x86-64, with the version of Highway of Debian 12."""

from __future__ import annotations

import hashlib
import sys

import numpy as np
from numpy.typing import DTypeLike

import gslts
from gslts._core import simd
from gslts.rendering.losses import photometric_loss

RECORDED = {
    "float32": "a98e61eefb49bfa3",
    "float64": "7781afaeb6b121fa",
}


def main() -> None:
    """Compare, on each instruction set with fused multiply-add."""
    fused = [name for name in simd.targets() if name != "sse4"]
    for target in fused:
        simd.use_target(target)
        for dtype, recorded in RECORDED.items():
            digest = training_digest(dtype)
            if digest != recorded:
                sys.exit(f"wheel_bits: {target}, {dtype}: {digest} instead of {recorded}")
    print(f"bits of training steps are those recorded: {', '.join(fused) or 'left out'}")


def training_digest(dtype: DTypeLike) -> str:
    """Hash the images and the map of three steps of training.

    Numbers are uniform and the pose has no sine, as functions of C libraries may differ.

    Args:
        dtype: float32 or float64.
    """
    rng, size = np.random.default_rng(0), 5000

    def uniform(low: float, high: float, *shape: int) -> np.ndarray:
        return rng.uniform(low, high, shape).astype(np.float32).astype(dtype)

    gaussians = gslts.GaussianMap(
        means=uniform(-1, 1, size, 3),
        quats=uniform(-1, 1, size, 4),
        log_scales=uniform(-5, -2, size, 3),
        logit_opacities=uniform(-3, 4, size),
        sh=uniform(-0.6, 0.6, size, 9, 3),
        features=uniform(-1, 1, size, 5),
    )
    pose = np.eye(4)
    pose[2, 3] = -2
    camera = gslts.Camera(
        fx=90, fy=85, cx=47.5, cy=30.25, width=97, height=61, world_from_camera=pose
    )
    rasterizer, adam, bits = gslts.Rasterizer(dtype), gslts.Adam(gaussians), hashlib.sha256()
    for _ in range(3):
        images = rasterizer.forward(adam.map, camera)
        loss = photometric_loss(images.rgb, uniform(0, 1, *images.rgb.shape))
        gradients = rasterizer.backward(
            dL_drgb=loss.dL_drgb, dL_ddepth=images.depth, dL_dfeatures=images.features
        )
        adam.step(gradients, gslts.AdamRates())
        for array in (images.rgb, images.depth, images.alpha, images.features, adam.map.means):
            bits.update(array.tobytes())
        bits.update(np.float64(loss.value).tobytes() + gradients.dL_dtwist.tobytes())
    for name in ("quats", "log_scales", "logit_opacities", "sh", "features"):
        bits.update(getattr(adam.map, name).tobytes())
    return bits.hexdigest()[:16]


if __name__ == "__main__":
    main()
