"""Noise and drawing functions for textures.

Images are float32 [h,w,3], sRGB in 0 to 1; masks and noise are float32 [h,w]. Only additions and
products are used, never transcendental functions, so that every machine draws the same pixels.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gslts.types import Bytes, Floats32

Rng = np.random.Generator
Field = Floats32
Image = Floats32
Colour = tuple[float, float, float]
Shape = tuple[int, int]


def lattice(rng: Rng, shape: Shape, cells: tuple[int, int]) -> Field:
    """Return value noise that repeats at the edges: random values, smoothly interpolated.

    Args:
        rng: Random stream.
        shape: (h, w), px.
        cells: Random values down and across.
    """
    rows, columns = min(cells[0], shape[0]), min(cells[1], shape[1])
    values = rng.random((rows, columns), np.float32)
    return _stretch(_stretch(values, shape[0]).T, shape[1]).T


def _stretch(values: Field, length: int) -> Field:
    """Interpolate rows to another number of rows, periodically."""
    count = len(values)
    at = (np.arange(length) * count / length).astype(np.float32)
    low = at.astype(np.int64)
    t = at - low
    t = (t * t * (3 - 2 * t))[:, None]
    below = values[low]
    result: Field = below + t * (values[(low + 1) % count] - below)
    return result


def octaves(rng: Rng, shape: Shape, cells: tuple[int, int], count: int, gain: float = 0.5) -> Field:
    """Return a sum of noises, each twice as fine as the one before.

    Args:
        rng: Random stream.
        shape: (h, w), px.
        cells: Random values of the first, down and across.
        count: Number of noises.
        gain: Ratio of their strengths.

    Returns:
        [h,w] float32, 0 to 1.
    """
    total = np.zeros(shape, np.float32)
    weight, weights = 1.0, 0.0
    for k in range(count):
        total += np.float32(weight) * lattice(rng, shape, (cells[0] << k, cells[1] << k))
        weights += weight
        weight *= gain
    total /= np.float32(weights)
    return total


def grain(rng: Rng, shape: Shape) -> Field:
    """Return white noise.

    Args:
        rng: Random stream.
        shape: (h, w), px.

    Returns:
        [h,w] float32, 0 to 1.
    """
    return rng.random(shape, np.float32)


def wave(phase: NDArray[np.floating]) -> Field:
    """Evaluate a smooth periodic wave with period 1.

    Args:
        phase: Any shape.

    Returns:
        float32, 0 to 1.
    """
    t = np.abs(2 * (phase - np.floor(phase)) - 1)
    result: Field = (t * t * (3 - 2 * t)).astype(np.float32, copy=False)
    return result


def contrast(field: Field, factor: float) -> Field:
    """Spread noise about its middle and clip it to 0 to 1.

    Args:
        field: [h,w] float32, 0 to 1.
        factor: Above 1 for more contrast.
    """
    result: Field = np.clip((field - 0.5) * np.float32(factor) + 0.5, 0, 1)
    return result


def blend(low: ArrayLike, high: ArrayLike, t: Field) -> Image:
    """Interpolate between two colours or images.

    Args:
        low: sRGB or [h,w,3].
        high: sRGB or [h,w,3].
        t: [h,w] float32, 0 to 1.
    """
    start, end = np.asarray(low, np.float32), np.asarray(high, np.float32)
    result: Image = start + (end - start) * t[:, :, None].astype(np.float32, copy=False)
    return result


def shade(image: Image, field: Field, amount: float) -> Image:
    """Brighten an image where a field is above 0.5, and darken it where it is below.

    Args:
        image: [h,w,3] float32.
        field: [h,w] float32, 0 to 1.
        amount: Largest change, relative.
    """
    result: Image = image * (1 + np.float32(2 * amount) * (field - 0.5))[:, :, None]
    return result


def tint(colour: Colour, factor: float, offset: float = 0.0) -> Colour:
    """Scale and shift a colour, at most to 1.

    Args:
        colour: sRGB.
        factor: Multiplied first.
        offset: Added.
    """
    red, green, blue = (min(1.0, channel * factor + offset) for channel in colour)
    return red, green, blue


def coordinates(shape: Shape) -> tuple[Field, Field]:
    """Return the coordinates of the centres of the pixels.

    Args:
        shape: (h, w), px.

    Returns:
        Down [h,1] and across [1,w] float32, 0 to 1.
    """
    down = (np.arange(shape[0], dtype=np.float32) + 0.5) / np.float32(shape[0])
    across = (np.arange(shape[1], dtype=np.float32) + 0.5) / np.float32(shape[1])
    return down[:, None], across[None, :]


def plain(shape: Shape, colour: Colour) -> Image:
    """Return an image of one colour.

    Args:
        shape: (h, w), px.
        colour: sRGB.
    """
    return np.full((*shape, 3), colour, np.float32)


def fill(image: Image, corners: tuple[float, float, float, float], colour: Colour) -> None:
    """Paint a rectangle.

    Args:
        image: [h,w,3] float32, changed in place.
        corners: Left, top, right and bottom, each 0 to 1.
        colour: sRGB.
    """
    h, w = image.shape[:2]
    left, top, right, bottom = corners
    image[round(top * h) : round(bottom * h), round(left * w) : round(right * w)] = colour


def spot(
    image: Image, at: tuple[float, float], size: tuple[float, float], colour: ArrayLike
) -> None:
    """Paint an ellipse.

    Args:
        image: [h,w,3] float32, changed in place.
        at: Centre, across and down, each 0 to 1.
        size: Half axes, across and down, each 0 to 1.
        colour: sRGB.
    """
    h, w = image.shape[:2]
    top, bottom = int(max(0, (at[1] - size[1]) * h)), int((at[1] + size[1]) * h) + 2
    left, right = int(max(0, (at[0] - size[0]) * w)), int((at[0] + size[0]) * w) + 2
    part = image[top:bottom, left:right]
    down, across = coordinates((h, w))
    inside = ((down[top:bottom] - at[1]) / size[1]) ** 2 + (
        (across[:, left:right] - at[0]) / size[0]
    ) ** 2 < 1
    part[inside] = colour


def to_bytes(image: Image) -> Bytes:
    """Convert an image to a texture.

    Args:
        image: [h,w,3] float32, clipped to 0 to 1.

    Returns:
        [h,w,3] uint8.
    """
    return (np.clip(image, 0, 1) * 255 + np.float32(0.5)).astype(np.uint8)
