"""Noise and simple drawing, from which textures are made.

Images are float32 [h,w,3], sRGB in 0 to 1; masks and noise are float32 [h,w]. Only additions and
products are used, never transcendental functions, so that every machine draws the same pixels.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Rng = np.random.Generator
Field = NDArray[np.float32]
Image = NDArray[np.float32]
Colour = tuple[float, float, float]


def lattice(rng: Rng, shape: tuple[int, int], cells: tuple[int, int]) -> Field:
    """Value noise in 0 to 1 that repeats at the edges: random values, smoothly interpolated.

    Args:
        rng: Random stream.
        shape: (h, w), px.
        cells: Random values down and across.
    """
    rows, columns = min(cells[0], shape[0]), min(cells[1], shape[1])
    values = rng.random((rows, columns), np.float32)
    return _stretched(_stretched(values, shape[0]).T, shape[1]).T


def _stretched(values: Field, length: int) -> Field:
    """Rows interpolated to another number of rows, around the end."""
    count = len(values)
    at = (np.arange(length) * count / length).astype(np.float32)
    low = at.astype(np.int64)
    t = at - low
    t = (t * t * (3 - 2 * t))[:, None]
    below = values[low]
    result: Field = below + t * (values[(low + 1) % count] - below)
    return result


def octaves(
    rng: Rng, shape: tuple[int, int], cells: tuple[int, int], count: int, gain: float = 0.5
) -> Field:
    """Sum of `count` noises, each twice as fine and `gain` times as strong, in 0 to 1."""
    total = np.zeros(shape, np.float32)
    weight, weights = 1.0, 0.0
    for k in range(count):
        total += np.float32(weight) * lattice(rng, shape, (cells[0] << k, cells[1] << k))
        weights += weight
        weight *= gain
    total /= np.float32(weights)
    return total


def grain(rng: Rng, shape: tuple[int, int]) -> Field:
    """White noise in 0 to 1."""
    return rng.random(shape, np.float32)


def wave(phase: NDArray[np.floating]) -> Field:
    """A smooth periodic wave in 0 to 1 with period 1."""
    t = np.abs(2 * (phase - np.floor(phase)) - 1)
    result: Field = (t * t * (3 - 2 * t)).astype(np.float32, copy=False)
    return result


def contrast(field: Field, factor: float) -> Field:
    """Noise spread about its middle and clipped to 0 to 1."""
    result: Field = np.clip((field - 0.5) * np.float32(factor) + 0.5, 0, 1)
    return result


def blend(low: ArrayLike, high: ArrayLike, t: Field) -> Image:
    """Between two colours or images, by a field [h,w] in 0 to 1."""
    start, end = np.asarray(low, np.float32), np.asarray(high, np.float32)
    result: Image = start + (end - start) * t[:, :, None].astype(np.float32, copy=False)
    return result


def shaded(image: Image, field: Field, amount: float) -> Image:
    """An image made brighter where the field is above 0.5 and darker where it is below."""
    result: Image = image * (1 + np.float32(2 * amount) * (field - 0.5))[:, :, None]
    return result


def tinted(colour: Colour, factor: float, offset: float = 0.0) -> Colour:
    """A colour times a factor plus an offset, at most 1."""
    red, green, blue = (min(1.0, channel * factor + offset) for channel in colour)
    return red, green, blue


def coordinates(shape: tuple[int, int]) -> tuple[Field, Field]:
    """Down [h,1] and across [1,w], 0 to 1, at the centres of the pixels."""
    down = (np.arange(shape[0], dtype=np.float32) + 0.5) / np.float32(shape[0])
    across = (np.arange(shape[1], dtype=np.float32) + 0.5) / np.float32(shape[1])
    return down[:, None], across[None, :]


def plain(shape: tuple[int, int], colour: Colour) -> Image:
    """One colour."""
    return np.full((*shape, 3), colour, np.float32)


def fill(image: Image, corners: tuple[float, float, float, float], colour: Colour) -> None:
    """Paints a rectangle (left, top, right, bottom, each 0 to 1) into an image."""
    h, w = image.shape[:2]
    left, top, right, bottom = corners
    image[round(top * h) : round(bottom * h), round(left * w) : round(right * w)] = colour


def spot(
    image: Image, at: tuple[float, float], size: tuple[float, float], colour: ArrayLike
) -> None:
    """Paints an ellipse, its middle and half axes (across, down) as shares of the image."""
    h, w = image.shape[:2]
    top, bottom = int(max(0, (at[1] - size[1]) * h)), int((at[1] + size[1]) * h) + 2
    left, right = int(max(0, (at[0] - size[0]) * w)), int((at[0] + size[0]) * w) + 2
    part = image[top:bottom, left:right]
    down, across = coordinates((h, w))
    inside = ((down[top:bottom] - at[1]) / size[1]) ** 2 + (
        (across[:, left:right] - at[0]) / size[0]
    ) ** 2 < 1
    part[inside] = colour


def to_bytes(image: Image) -> NDArray[np.uint8]:
    """As a texture: uint8 [h,w,3]."""
    return (np.clip(image, 0, 1) * 255 + np.float32(0.5)).astype(np.uint8)
