"""Exposures of training frames: found where images determine them, and likely elsewhere."""

import numpy as np
import pytest

from gslts import camera_from_fov
from gslts.core.frame import RgbdFrame
from gslts.mapping.exposures import fit_likely_exposure, is_plausible, refit_exposure
from gslts.mapping.observation import Observation
from gslts.rendering.losses import Exposure, apply_exposure, fit_exposure

HEIGHT, WIDTH = 48, 64


def rendering(contrast: float = 0.2) -> np.ndarray:
    """Return [H,W,3] squares of 4 px around a grey of 0.5."""
    rng = np.random.default_rng(0)
    squares = rng.normal(0.5, contrast, (HEIGHT // 4, WIDTH // 4, 3)).astype(np.float32)
    return squares.repeat(4, 0).repeat(4, 1)


def exposed(rgb: np.ndarray, gain: float) -> np.ndarray:
    exposure = Exposure(gain=(gain,) * 3, offset=(0.0, 0.0, 0.0))
    return apply_exposure(rgb, exposure).astype(np.float32)


@pytest.mark.parametrize("gain", [0.5, 0.8, 1.6])
def test_the_gain_of_a_frame_is_found(gain: float) -> None:
    rgb = rendering()
    found = fit_likely_exposure(rgb, exposed(rgb, gain), None)
    np.testing.assert_allclose(found.gain, gain, rtol=0.02)
    np.testing.assert_allclose(found.offset, 0, atol=0.005)


def test_white_balance_is_found() -> None:
    rgb = rendering()
    photo = (rgb * (1.2, 1.0, 0.8)).astype(np.float32)
    np.testing.assert_allclose(fit_likely_exposure(rgb, photo, None).gain, (1.2, 1, 0.8), rtol=0.01)


def test_errors_of_the_rendering_lower_the_gain_less() -> None:
    """Compare with least squares, whose error more contrast makes up for, again and again."""
    photo = rendering()
    noise = np.random.default_rng(1).normal(0, 0.15, photo.shape)
    rgb = (photo + noise).astype(np.float32)
    least_squares, likely = fit_exposure(rgb, photo), fit_likely_exposure(rgb, photo, None)
    assert np.max(least_squares.gain) < 0.7
    assert (np.subtract(1, likely.gain) < 0.75 * np.subtract(1, least_squares.gain)).all()


def test_a_plain_rendering_gives_a_likely_exposure() -> None:
    noise = np.random.default_rng(1).normal(0, 1e-3, (HEIGHT, WIDTH, 3))
    rgb = (0.5 + noise).astype(np.float32)
    photo = (0.4 - 5 * noise).astype(np.float32)
    assert not is_plausible(fit_exposure(rgb, photo))
    found = fit_likely_exposure(rgb, photo, None)
    assert is_plausible(found)
    mean = np.multiply(found.gain, 0.5) + found.offset
    np.testing.assert_allclose(mean, 0.4, atol=0.01)


def test_masked_pixels_do_not_count() -> None:
    rgb = rendering()
    photo = exposed(rgb, 0.8)
    mask = np.ones((HEIGHT, WIDTH), np.bool_)
    mask[:, :20] = False
    expected = fit_likely_exposure(rgb, photo, mask)
    rgb[~mask], photo[~mask] = 1, 0
    found = fit_likely_exposure(rgb, photo, mask)
    assert (found.gain, found.offset) == (expected.gain, expected.offset)
    nothing = fit_likely_exposure(rgb, photo, np.zeros_like(mask))
    assert (nothing.gain, nothing.offset) == (Exposure().gain, Exposure().offset)


def test_an_exposure_that_is_not_plausible_leaves_the_last_one() -> None:
    rgb = rendering()
    camera = camera_from_fov(WIDTH, HEIGHT, 1.0, np.eye(4))
    black, depth = np.zeros((HEIGHT, WIDTH, 3), np.uint8), np.ones((HEIGHT, WIDTH), np.float32)
    observation = Observation.of(RgbdFrame(black, depth, camera))
    refit_exposure(observation, rgb, exposed(rgb, 0.7), None)
    assert not observation.exposure_rejected
    np.testing.assert_allclose(observation.exposure.gain, 0.7, rtol=0.01)
    refit_exposure(observation, rgb, exposed(rgb, 0.1), None)
    assert observation.exposure_rejected
    np.testing.assert_allclose(observation.exposure.gain, 0.7, rtol=0.01)
