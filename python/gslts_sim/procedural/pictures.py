"""Pictures for walls, and the images that windows and mirrors show.

Each function draws an image [h,w,3] that does not repeat.
"""

from __future__ import annotations

import numpy as np

from gslts_sim.procedural.inks import BLACK, PAPER, ink
from gslts_sim.procedural.noise import (
    Colour,
    Image,
    Rng,
    Shape,
    blend,
    contrast,
    coordinates,
    fill,
    lattice,
    octaves,
    plain,
    shade,
    spot,
    tint,
)


def landscape(rng: Rng, shape: Shape) -> Image:
    """Draw hills one behind the other under a sky with a sun.

    Args:
        rng: Random stream.
        shape: (h, w), px.
    """
    down, _ = coordinates(shape)
    sky, haze = (
        ((0.45, 0.66, 0.88), (0.97, 0.86, 0.7))
        if rng.random() < 0.6
        else ((0.35, 0.3, 0.5), (0.97, 0.6, 0.4))
    )
    clouds = contrast(octaves(rng, shape, (4, 2), 4), 2.2)
    image = blend(sky, haze, np.broadcast_to(np.clip(down * 1.6, 0, 1), shape))
    image = blend(image, (1, 0.98, 0.95), 0.6 * clouds * np.clip(1 - 1.6 * down, 0, 1))
    spot(image, (rng.uniform(0.2, 0.8), rng.uniform(0.15, 0.3)), (0.06, 0.08), (1, 0.95, 0.75))
    near = np.array(
        [(0.16, 0.4, 0.12), (0.62, 0.44, 0.12), (0.1, 0.36, 0.3), (0.5, 0.22, 0.14)][
            rng.integers(4)
        ]
    )
    for k in range(5):
        ridge = 0.4 + 0.12 * k + 0.16 * (octaves(rng, (8, shape[1]), (1, 3 + k), 4)[0] - 0.5)
        below = down > ridge[None, :]
        t = np.float32(k / 4)
        hill = plain(shape, tuple(np.array([0.55, 0.66, 0.76]) * (1 - t) + near * t))
        hill = shade(hill, octaves(rng, shape, (24, 12), 3), 0.35)
        image = np.where(below[:, :, None], hill, image)
    return shade(image, lattice(rng, shape, (shape[0] // 3, shape[1] // 3)), 0.12)


def abstract(rng: Rng, shape: Shape) -> Image:
    """Draw rectangles, discs and brush strokes.

    Args:
        rng: Random stream.
        shape: (h, w), px.
    """
    image = shade(plain(shape, PAPER), octaves(rng, shape, (8, 8), 4), 0.12)
    for _ in range(7):
        x, y = rng.uniform(0.05, 0.6, 2)
        fill(image, (x, y, x + rng.uniform(0.1, 0.35), y + rng.uniform(0.1, 0.35)), ink(rng))
    for _ in range(5):
        at, radius = (rng.uniform(0.15, 0.85), rng.uniform(0.15, 0.85)), rng.uniform(0.05, 0.16)
        spot(image, at, (radius, radius * shape[1] / shape[0]), ink(rng))
    for _ in range(3):
        x = rng.uniform(0.1, 0.9)
        fill(image, (x, 0.04, x + 0.015, 0.96), BLACK)
    strokes = lattice(rng, shape, (shape[0] // 2, 12))
    return shade(image, strokes, 0.2)


def still_life(rng: Rng, shape: Shape) -> Image:
    """Draw a vase with flowers on a table.

    Args:
        rng: Random stream.
        shape: (h, w), px.
    """
    down, _ = coordinates(shape)
    wall, cloth = ink(rng), ink(rng)
    image = shade(plain(shape, tint(wall, 0.4, 0.5)), octaves(rng, shape, (6, 6), 4), 0.3)
    image = np.where((down > 0.72)[:, :, None], np.array(cloth, np.float32), image).astype(
        np.float32
    )
    spot(image, (0.5, 0.7), (0.14, 0.17), ink(rng))
    fill(image, (0.44, 0.48, 0.56, 0.6), (0.3, 0.4, 0.3))
    for _ in range(26):
        at = 0.5 + 0.3 * (rng.random() + rng.random() - 1), 0.36 + 0.2 * (2 * rng.random() - 1)
        spot(image, at, (0.05, 0.04), (0.2, 0.42, 0.2) if rng.random() < 0.4 else ink(rng))
        spot(image, at, (0.015, 0.012), (0.95, 0.85, 0.4))
    return shade(image, octaves(rng, shape, (32, 32), 2), 0.25)


def picture(rng: Rng, shape: Shape) -> Image:
    """Draw one of the three kinds of pictures for walls.

    Args:
        rng: Random stream.
        shape: (h, w), px.
    """
    return (landscape, abstract, still_life)[int(rng.integers(3))](rng, shape)


def outdoors(rng: Rng, shape: Shape) -> Image:
    """Draw the view out of a window: sky, houses, trees and a lawn.

    Args:
        rng: Random stream.
        shape: (h, w), px.
    """
    down, _ = coordinates(shape)
    clouds = contrast(octaves(rng, shape, (5, 2), 4), 2.5)
    image = blend((0.55, 0.76, 0.97), (1, 1, 1), clouds * np.clip(1.3 - 1.5 * down, 0, 1))
    for _ in range(3):
        left, top = rng.uniform(-0.1, 0.8), rng.uniform(0.42, 0.58)
        wall = ((0.86, 0.78, 0.68), (0.75, 0.5, 0.42), (0.9, 0.88, 0.84))[int(rng.integers(3))]
        right = left + rng.uniform(0.22, 0.35)
        fill(image, (max(left, 0), top, min(right, 1), 0.8), wall)
        fill(image, (max(left - 0.02, 0), top - 0.06, min(right + 0.02, 1), top), (0.5, 0.28, 0.22))
        for k in range(3):
            x = left + 0.04 + k * 0.09
            if 0 < x < min(right, 1) - 0.05:
                fill(image, (x, top + 0.05, x + 0.04, top + 0.14), (0.3, 0.38, 0.48))
    for _ in range(16):
        at, radius = (rng.uniform(0, 1), rng.uniform(0.6, 0.76)), rng.uniform(0.05, 0.12)
        green = rng.uniform(0.75, 1.15)
        spot(image, at, (radius, radius * 0.9), (0.3 * green, 0.52 * green, 0.24 * green))
    lawn = blend((0.36, 0.56, 0.28), (0.52, 0.7, 0.38), octaves(rng, shape, (32, 16), 3))
    image = np.where((down > 0.76)[:, :, None], lawn, image)
    image = shade(image, octaves(rng, shape, (48, 48), 2), 0.16)
    result: Image = np.minimum(image * np.float32(1.08) + np.float32(0.04), 1)
    return result


def reflection(rng: Rng, shape: Shape, wall: Colour) -> Image:
    """Draw a mirror's image: a wall, a bright window and a floor, out of focus.

    Args:
        rng: Random stream.
        shape: (h, w), px.
        wall: Colour of the wall, sRGB.
    """
    down, _ = coordinates(shape)
    image = shade(plain(shape, wall), octaves(rng, shape, (3, 3), 3), 0.3)
    image = np.where((down > 0.8)[:, :, None], np.array((0.5, 0.4, 0.3), np.float32), image)
    spot(image, (0.35, 0.35), (0.2, 0.2), (0.96, 0.98, 1.0))
    spot(image, (0.75, 0.66), (0.2, 0.14), ink(rng))
    return shade(image.astype(np.float32), octaves(rng, shape, (24, 24), 2), 0.06)
