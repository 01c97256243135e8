"""Losses compared with plain NumPy."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import gslts

Image = NDArray[Any]


def images(dtype: Any, height: int = 40, width: int = 50) -> tuple[Image, Image]:
    rng = np.random.default_rng(3)
    y, x = np.indices((height, width))[..., None]
    target = 0.5 + 0.4 * np.sin(0.3 * x + np.arange(3)) * np.cos(0.2 * y)
    target = target + 0.05 * rng.standard_normal(target.shape)
    rgb = target + 0.1 * rng.standard_normal(target.shape)
    return rgb.astype(dtype), target.astype(dtype)


def window_means(image: Image, wanted: Image) -> Image:
    """Return means of pixels in the mask under the 11 x 11 Gaussian window around each."""
    weights = np.exp(-0.5 * (np.arange(-5, 6) / 1.5) ** 2)

    def sums(values: Image) -> Image:
        values = np.pad(values, ((5, 5), (5, 5), (0, 0)))
        for axis in (0, 1):
            values = np.lib.stride_tricks.sliding_window_view(values, 11, axis=axis) @ weights
        return values

    return sums(image * wanted) / np.maximum(sums(wanted), 1e-300)


def ssim_of(rgb: Image, target: Image, wanted: Image) -> float:
    wanted = wanted[..., None].astype(float)
    mean_a, mean_b = window_means(rgb, wanted), window_means(target, wanted)
    var_a = window_means(rgb**2, wanted) - mean_a**2
    var_b = window_means(target**2, wanted) - mean_b**2
    cov = window_means(rgb * target, wanted) - mean_a * mean_b
    ssim = ((2 * mean_a * mean_b + 1e-4) * (2 * cov + 9e-4)) / (
        (mean_a**2 + mean_b**2 + 1e-4) * (var_a + var_b + 9e-4)
    )
    return float((ssim * wanted).sum() / (3 * wanted.sum()))


@pytest.mark.parametrize(("dtype", "tolerance"), [(np.float32, 1e-4), (np.float64, 1e-12)])
@pytest.mark.parametrize("masked", [False, True])
def test_photometric_loss_is_l1_and_ssim(dtype: Any, tolerance: float, masked: bool) -> None:
    rgb, target = images(dtype)
    wanted = np.ones(rgb.shape[:2], bool)
    if masked:
        wanted = np.random.default_rng(1).uniform(size=wanted.shape) < 0.4
    loss = gslts.losses.photometric_loss(
        rgb, target, mask=wanted if masked else None, dssim_weight=0.3
    )
    l1 = np.abs(rgb.astype(float) - target)[wanted].mean()
    ssim = ssim_of(rgb.astype(float), target.astype(float), wanted)
    assert loss.l1 == pytest.approx(l1, abs=tolerance)
    assert loss.ssim == pytest.approx(ssim, abs=tolerance)
    assert loss.value == pytest.approx(0.7 * l1 + 0.3 * (1 - ssim), abs=tolerance)
    assert loss.dL_drgb.dtype == dtype
    assert loss.dL_drgb.shape == rgb.shape
    assert not loss.dL_drgb[~wanted].any()


def test_following_the_gradient_lowers_the_loss() -> None:
    rgb, target = images(np.float32)
    before = gslts.losses.photometric_loss(rgb, target)
    after = gslts.losses.photometric_loss(rgb - 20 * before.dL_drgb, target)
    assert after.value < before.value
    assert after.ssim > before.ssim


def test_exposure_is_numpys_least_squares_fit() -> None:
    rgb, target = images(np.float64)
    found = gslts.losses.fit_exposure(rgb, target)
    for c in range(3):
        gain, offset = np.polyfit(rgb[..., c].ravel(), target[..., c].ravel(), 1)
        assert found.gain[c] == pytest.approx(gain)
        assert found.offset[c] == pytest.approx(offset, abs=1e-12)
    corrected = rgb * found.gain + found.offset
    by_exposure = gslts.losses.photometric_loss(rgb, target, exposure=found)
    by_hand = gslts.losses.photometric_loss(corrected, target)
    assert by_exposure.value == pytest.approx(by_hand.value)
    np.testing.assert_allclose(by_exposure.dL_drgb, by_hand.dL_drgb * found.gain, atol=1e-12)
    assert eval(repr(found), {"Exposure": gslts.losses.Exposure}) == found


def test_depth_loss_counts_measured_and_rendered_pixels() -> None:
    depth = np.array([[2.0, 0.0, 1.0], [1.0, 3.0, 4.0]], np.float32)
    target = np.array([[1.5, 2.0, 0.0], [np.nan, 4.0, 7.0]], np.float32)
    mask = np.array([[True, True, True], [True, True, False]])
    loss = gslts.losses.depth_loss(depth, target, mask=mask)
    assert loss.count == 2
    assert loss.value == 0.75
    np.testing.assert_array_equal(loss.dL_ddepth, [[0.5, 0, 0], [0, -0.5, 0]])


def test_a_tiny_depth_is_no_measurement() -> None:
    target = np.array([[1e-40, 1e-36, 2.0]], np.float32)
    loss = gslts.losses.depth_loss(np.full((1, 3), 1000, np.float32), target, relative=True)
    assert loss.count == 1
    assert loss.value == 499
    np.testing.assert_array_equal(loss.dL_ddepth, [[0, 0, 0.5]])


def test_an_exposure_survives_copies() -> None:
    exposure = gslts.losses.Exposure(gain=(1.5, 2, 3), offset=(0.25, 0, -1))
    assert pickle.loads(pickle.dumps(exposure)) == exposure
    assert copy.deepcopy(exposure) == exposure


def test_bad_input_is_rejected() -> None:
    rgb, target = images(np.float32, 6, 7)
    with pytest.raises(ValueError, match=r"photometric_loss: rgb: expected float32 or float64"):
        gslts.losses.photometric_loss(rgb.astype(np.float16), target)
    with pytest.raises(ValueError, match=r"target: expected .* float32 .* got float64"):
        gslts.losses.photometric_loss(rgb, target.astype(np.float64))
    with pytest.raises(ValueError, match=r"rgb: expected .* shape \(6, 7, 3\), got"):
        gslts.losses.photometric_loss(rgb[..., 0].copy(), target)
    with pytest.raises(ValueError, match=r"rgb: expected"):
        gslts.losses.photometric_loss(rgb[0, 0].copy(), target)
    with pytest.raises(ValueError, match=r"mask: expected"):
        gslts.losses.photometric_loss(rgb, target, mask=np.ones((7, 6), bool))
    with pytest.raises(ValueError, match=r"dssim_weight must be in \[0, 1\], got 2"):
        gslts.losses.photometric_loss(rgb, target, dssim_weight=2.0)
    target[2, 4, 1] = np.nan
    with pytest.raises(ValueError, match=r"photometric_loss: target\[2,4,1\] is nan"):
        gslts.losses.photometric_loss(rgb, target)
    with pytest.raises(ValueError, match=r"depth_loss: depth\[0,0\] is -1"):
        gslts.losses.depth_loss(np.full((2, 2), -1.0), np.ones((2, 2)))
