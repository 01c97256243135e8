"""Comparison of renderings that may differ where a Gaussian sits on a threshold."""

import numpy as np
import oracle
from numpy.typing import DTypeLike

from gslts.rendering.rasterizer import Images

# Relative distance to a threshold (alpha_min, transmittance_min) below which rounding may decide,
# and how close the images must be elsewhere.
BAND = {np.dtype(np.float64): 1e-9, np.dtype(np.float32): 2e-3}
TOLERANCE = {np.dtype(np.float64): 1e-10, np.dtype(np.float32): 2e-4}


def assert_close_outside_band(images: Images, expected: oracle.Rendering, dtype: DTypeLike) -> None:
    """Tight outside the band; inside, what one Gaussian that flips can change."""
    clear = expected.margin > BAND[np.dtype(dtype)]
    tolerance = TOLERANCE[np.dtype(dtype)]
    for name in ("rgb", "depth", "alpha", "features"):
        actual, wanted = getattr(images, name), getattr(expected, name)
        assert np.isfinite(actual).all(), name
        np.testing.assert_allclose(
            actual[clear], wanted[clear], rtol=tolerance, atol=tolerance, err_msg=name
        )
    np.testing.assert_allclose(
        images.alpha, expected.alpha, rtol=0, atol=expected.max_flip + tolerance
    )
