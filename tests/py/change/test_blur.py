"""Blurred frames and blurred parts of frames."""

import cv2
import numpy as np
import pytest

from gslts.change.blur import Detail

WIDTH, HEIGHT = 160, 120
KNOWN = np.ones((HEIGHT, WIDTH), np.bool_)


def room(seed: int = 0) -> np.ndarray:
    """Return an image with detail everywhere, and edges between larger areas."""
    rng = np.random.default_rng(seed)
    areas = rng.uniform(0.2, 0.8, (6, 8, 3)).astype(np.float32)
    image = cv2.resize(areas, (WIDTH, HEIGHT), interpolation=cv2.INTER_NEAREST)
    return image + rng.normal(0, 0.05, image.shape).astype(np.float32)


def smeared(image: np.ndarray) -> np.ndarray:
    return cv2.GaussianBlur(image, (0, 0), 3.0)


def noisy(image: np.ndarray) -> np.ndarray:
    return image + np.random.default_rng(1).normal(0, 0.005, image.shape).astype(np.float32)


def test_a_sharp_frame_is_not_blurred() -> None:
    image = room()
    assert not Detail(noisy(image), image, KNOWN).is_blurred()
    assert not Detail(noisy(image), image, KNOWN).blurred_pixels().any()


def test_a_blurred_frame_is_blurred() -> None:
    assert Detail(noisy(smeared(room())), room(), KNOWN).is_blurred()


@pytest.mark.parametrize("share", [0.25, 0.5])
def test_the_part_behind_a_smeared_window_is_found(share: float) -> None:
    image, edge = room(), int(share * WIDTH)
    frame = image.copy()
    frame[:, :edge] = smeared(image)[:, :edge]
    assert not Detail(noisy(frame), image, KNOWN).is_blurred()
    found = Detail(noisy(frame), image, KNOWN).blurred_pixels()
    assert found[:, :edge].mean() > 0.95
    assert found[:, edge + WIDTH // 8 :].mean() < 0.02


def test_motion_blur_in_one_direction_is_found() -> None:
    image = room()
    frame = image.copy()
    frame[:60] = cv2.blur(image, (9, 1))[:60]
    assert Detail(noisy(frame), image, KNOWN).blurred_pixels()[:60].mean() > 0.95


def test_what_is_plain_instead_of_a_removed_object_is_not_blurred() -> None:
    plain = np.full((HEIGHT, WIDTH, 3), 0.5, np.float32)
    with_object = plain.copy()
    with_object[30:90, 40:110] = room()[30:90, 40:110]
    assert not Detail(noisy(plain), with_object, KNOWN).blurred_pixels().any()


def test_a_plain_wall_is_not_blurred() -> None:
    wall = np.full((HEIGHT, WIDTH, 3), 0.5, np.float32)
    assert not Detail(wall, noisy(wall), KNOWN).blurred_pixels().any()


def test_unknown_pixels_are_neither_compared_nor_found() -> None:
    image, known = room(), KNOWN.copy()
    known[:, :80] = False
    frame = image.copy()
    frame[:, :70] = smeared(image)[:, :70]
    assert not Detail(noisy(frame), image, known).blurred_pixels().any()
    assert not Detail(noisy(frame), image, ~KNOWN).blurred_pixels().any()
