"""Exposure between a map and a frame in which a part changed."""

import numpy as np
import pytest

from gslts.change.exposure import robust_exposure
from gslts.rendering.losses import Exposure, apply_exposure, fit_exposure

GAIN, OFFSET = (0.8, 1.1, 0.95), (0.05, -0.03, 0.02)
HEIGHT, WIDTH = 90, 120
KNOWN = np.ones((HEIGHT, WIDTH), np.bool_)


def room(seed: int = 0) -> np.ndarray:
    """Return [H,W,3] squares of 6 px in random colours."""
    rng = np.random.default_rng(seed)
    squares = rng.uniform(0.1, 0.8, (HEIGHT // 6, WIDTH // 6, 3)).astype(np.float32)
    return squares.repeat(6, 0).repeat(6, 1)


def photo_of(rgb: np.ndarray) -> np.ndarray:
    noise = np.random.default_rng(1).normal(0, 0.01, rgb.shape)
    photo = apply_exposure(rgb, Exposure(gain=GAIN, offset=OFFSET)) + noise
    return photo.astype(np.float32)


def error(exposure: Exposure) -> float:
    """Return the maximum error of gains and offsets."""
    return max(
        np.abs(np.subtract(exposure.gain, GAIN)).max(),
        np.abs(np.subtract(exposure.offset, OFFSET)).max(),
    )


@pytest.mark.parametrize("color", [(0.95, 0.1, 0.05), (0.02, 0.02, 0.02), (0.9, 0.9, 0.9)])
def test_changed_pixels_do_not_count(color: tuple[float, float, float]) -> None:
    rgb = room()
    photo = photo_of(rgb)
    photo[:, : WIDTH // 5] = color  # 20 % of the image.
    assert error(robust_exposure(rgb, photo, KNOWN)) < 0.02
    assert error(fit_exposure(rgb, photo)) > 0.1


def test_unknown_pixels_do_not_count() -> None:
    rgb = room()
    photo = photo_of(rgb)
    known = KNOWN.copy()
    known[:, : WIDTH // 2] = False
    photo[:, : WIDTH // 2] = room(5)[:, : WIDTH // 2]
    assert error(robust_exposure(rgb, photo, known)) < 0.02
    assert error(robust_exposure(rgb, photo, KNOWN)) > 0.05


def test_clipped_colours_do_not_count() -> None:
    rgb = np.float32(1.25) * room()
    photo = photo_of(rgb).clip(0, 1)
    assert 0.05 < (photo == 1).any(axis=-1).mean() < 0.3
    assert error(robust_exposure(rgb, photo, KNOWN)) < 0.02


def test_without_known_pixels_exposure_is_the_identity() -> None:
    rgb = room()
    exposure = robust_exposure(rgb, photo_of(rgb), ~KNOWN)
    assert exposure.gain == pytest.approx((1, 1, 1))
    assert exposure.offset == pytest.approx((0, 0, 0))
