"""Images of printed surfaces and displays, which fit one side exactly and do not repeat.

Each function draws an image [h,w,3].
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from gslts_sim.procedural.inks import BLACK, PAPER, ink
from gslts_sim.procedural.lettering import write, write_lines
from gslts_sim.procedural.noise import (
    Colour,
    Image,
    Rng,
    Shape,
    blend,
    coordinates,
    fill,
    grain,
    lattice,
    octaves,
    plain,
    shade,
    spot,
    tint,
    wave,
)
from gslts_sim.procedural.pictures import landscape

_TITLES = (
    "ATLAS", "THE SEA", "RIVERS", "NOVA", "GARDENS", "ORBIT", "SILENCE", "MAPS", "BIRDS",
    "NORTH", "THE TREE", "HISTORY", "LIGHT", "VOYAGE", "STARS", "MUSIC", "CITIES", "COOKING",
)  # fmt: skip


def _title(rng: Rng) -> str:
    return _TITLES[int(rng.integers(len(_TITLES)))]


def book_cover(rng: Rng, shape: Shape) -> Image:
    """Draw a cover: cloth, a title, an author and a vignette.

    Args:
        rng: Random stream.
        shape: (h, w), px.
    """
    colour, second = ink(rng), ink(rng)
    image = shade(plain(shape, colour), octaves(rng, shape, (16, 16), 3, 0.7), 0.2)
    kind = int(rng.integers(3))
    if kind == 0:
        fill(image, (0.1, 0.38, 0.9, 0.8), second)
        spot(image, (0.5, 0.58), (0.25, 0.15), PAPER)
    elif kind == 1:
        for k in range(5):
            fill(image, (0.0, 0.45 + 0.09 * k, 1.0, 0.49 + 0.09 * k), second)
    else:
        spot(image, (0.5, 0.62), (0.34, 0.23), second)
        spot(image, (0.58, 0.56), (0.16, 0.1), PAPER)
    fill(image, (0.06, 0.1, 0.94, 0.3), PAPER)
    write(image, _title(rng), (0.1, 0.13, 0.9, 0.27), BLACK)
    write(image, _title(rng), (0.2, 0.86, 0.8, 0.93), PAPER)
    return shade(image, grain(rng, shape), 0.06)


def book_spines(rng: Rng, shape: Shape, count: int) -> Image:
    """Draw the spines of books that stand side by side.

    Args:
        rng: Random stream.
        shape: (h, w), px.
        count: Number of books.
    """
    h, w = shape
    image = plain(shape, BLACK)
    edges = np.concatenate([[0], np.cumsum(rng.uniform(0.6, 1.4, count))])
    edges /= edges[-1]
    for left, right in pairwise(edges):
        colour, second = ink(rng), PAPER if rng.random() < 0.6 else ink(rng)
        fill(image, (left, 0, right, 1), colour)
        for at in rng.choice([0.08, 0.16, 0.78, 0.86, 0.92], 2, replace=False):
            fill(image, (left, at, right, at + 0.03), second)
        # The title runs up the spine: written on its side, then turned.
        x0, x1 = round(left * w), round(right * w)
        spine = image[round(0.22 * h) : round(0.74 * h), x0:x1]
        if spine.shape[1] > 6:
            turned = np.ascontiguousarray(np.rot90(spine, -1))
            write(turned, _title(rng), (0.0, 0.15, 1.0, 0.85), second)
            spine[:] = np.rot90(turned)
        image[:, max(0, x1 - 1) : x1] = BLACK
    return shade(image, octaves(rng, shape, (32, 32), 2), 0.12)


def package(rng: Rng, shape: Shape, name: str, colour: Colour) -> Image:
    """Draw the front of a box or a bottle's label: brand, picture, small print.

    Args:
        rng: Random stream.
        shape: (h, w), px.
        name: Brand, in capital letters.
        colour: Main colour, sRGB.
    """
    second = ink(rng)
    image = shade(plain(shape, colour), octaves(rng, shape, (6, 6), 4), 0.12)
    fill(image, (0.0, 0.0, 1.0, 0.05), second)
    fill(image, (0.0, 0.95, 1.0, 1.0), second)
    fill(image, (0.05, 0.1, 0.95, 0.36), PAPER)
    write(image, name, (0.08, 0.12, 0.92, 0.34), second if second != colour else BLACK)
    spot(image, (0.5, 0.58), (0.36, 0.17), second)
    for _ in range(7):
        at = rng.uniform(0.28, 0.72), rng.uniform(0.5, 0.66)
        spot(image, at, (0.07, 0.05), ink(rng))
    write_lines(image, rng, (0.1, 0.8, 0.62, 0.93), 4, BLACK)
    bars = rng.random(12) < 0.5
    for k in np.flatnonzero(bars):
        fill(image, (0.7 + 0.02 * k, 0.8, 0.71 + 0.02 * k, 0.92), BLACK)
    return shade(image, grain(rng, shape), 0.05)


def desktop(rng: Rng, shape: Shape) -> Image:
    """Draw a computer's screen: wallpaper, windows with text, a bar.

    Args:
        rng: Random stream.
        shape: (h, w), px.
    """
    image = landscape(rng, shape) * np.float32(0.9)
    for left, top in ((0.06, 0.1), (0.42, 0.3)):
        fill(image, (left, top, left + 0.48, top + 0.5), (0.96, 0.96, 0.97))
        fill(image, (left, top, left + 0.48, top + 0.05), ink(rng))
        write_lines(image, rng, (left + 0.03, top + 0.09, left + 0.44, top + 0.46), 9, BLACK)
    fill(image, (0, 0.93, 1, 1), (0.15, 0.16, 0.2))
    for k in range(8):
        fill(image, (0.03 + 0.06 * k, 0.945, 0.07 + 0.06 * k, 0.985), ink(rng))
    return image


def broadcast(rng: Rng, shape: Shape) -> Image:
    """Draw a television's picture: news above a banner.

    Args:
        rng: Random stream.
        shape: (h, w), px.
    """
    image = landscape(rng, shape) * np.float32(0.85)
    spot(image, (0.3, 0.62), (0.13, 0.3), ink(rng))
    spot(image, (0.3, 0.34), (0.055, 0.13), (0.85, 0.65, 0.52))
    fill(image, (0, 0.8, 1, 0.94), (0.1, 0.16, 0.4))
    fill(image, (0, 0.8, 0.2, 0.94), (0.75, 0.12, 0.14))
    write(image, "NEWS", (0.02, 0.82, 0.18, 0.92), PAPER)
    write(image, "WEATHER TODAY: SUN", (0.23, 0.82, 0.95, 0.92), PAPER)
    return image


def keyboard(rng: Rng, shape: Shape, body: Colour) -> Image:
    """Draw keys in five rows above a touch pad.

    Args:
        rng: Random stream.
        shape: (h, w), px.
        body: Colour around the keys, sRGB.
    """
    image = shade(plain(shape, body), grain(rng, shape), 0.06)
    for row in range(5):
        for column in range(13):
            x, y = 0.06 + column * 0.068, 0.06 + row * 0.105
            width = 0.058 if row < 4 or not 3 <= column <= 7 else 0.068
            fill(image, (x, y, x + width, y + 0.085), (0.13, 0.13, 0.15))
            fill(image, (x + 0.018, y + 0.03, x + 0.034, y + 0.055), (0.75, 0.75, 0.78))
    fill(image, (0.34, 0.64, 0.68, 0.94), tint(body, 0.85))
    return image


def remote(rng: Rng, shape: Shape) -> Image:
    """Draw the buttons of a remote control, in an upright image.

    Args:
        rng: Random stream.
        shape: (h, w), px.
    """
    image = shade(plain(shape, (0.14, 0.14, 0.16)), grain(rng, shape), 0.1)
    spot(image, (0.25, 0.06), (0.1, 0.025), (0.85, 0.15, 0.12))
    for row in range(6):
        for column in range(3):
            at = 0.24 + 0.26 * column, 0.16 + 0.065 * row
            spot(image, at, (0.09, 0.022), (0.72, 0.72, 0.75))
    spot(image, (0.5, 0.66), (0.34, 0.095), (0.55, 0.55, 0.58))
    spot(image, (0.5, 0.66), (0.15, 0.042), (0.2, 0.2, 0.22))
    for k, colour in enumerate(
        ((0.8, 0.2, 0.2), (0.2, 0.6, 0.3), (0.9, 0.75, 0.2), (0.2, 0.4, 0.8))
    ):
        fill(image, (0.14 + 0.19 * k, 0.8, 0.28 + 0.19 * k, 0.83), colour)
    write(image, "TV", (0.3, 0.88, 0.7, 0.96), PAPER)
    return image


def phone(rng: Rng, shape: Shape) -> Image:
    """Draw a telephone's screen with icons.

    Args:
        rng: Random stream.
        shape: (h, w), px.
    """
    image = landscape(rng, shape)
    for row in range(5):
        for column in range(4):
            x, y = 0.1 + 0.21 * column, 0.14 + 0.14 * row
            fill(image, (x, y, x + 0.15, y + 0.085), ink(rng))
            fill(image, (x + 0.05, y + 0.025, x + 0.1, y + 0.055), PAPER)
    write(image, "12:30", (0.25, 0.02, 0.75, 0.11), PAPER)
    fill(image, (0, 0, 0.04, 1), BLACK)
    fill(image, (0.96, 0, 1, 1), BLACK)
    return image


def clock_face(rng: Rng, shape: Shape) -> Image:
    """Draw a dial with marks and hands.

    Args:
        rng: Random stream.
        shape: (h, w), px.
    """
    image = shade(plain(shape, PAPER), octaves(rng, shape, (8, 8), 3), 0.06)
    spot(image, (0.5, 0.5), (0.5, 0.5), BLACK)
    spot(image, (0.5, 0.5), (0.45, 0.45), (0.97, 0.96, 0.92))
    # The twelve directions, without trigonometry: (1, 0), (0.866, 0.5), (0.5, 0.866) turned.
    for x, y in ((1, 0), (0.866, 0.5), (0.5, 0.866)):
        for dx, dy in ((x, y), (-y, x), (-x, -y), (y, -x)):
            spot(image, (0.5 + 0.38 * dx, 0.5 + 0.38 * dy), (0.03, 0.03), BLACK)
    fill(image, (0.48, 0.2, 0.52, 0.52), BLACK)
    fill(image, (0.48, 0.48, 0.75, 0.52), BLACK)
    spot(image, (0.5, 0.5), (0.05, 0.05), (0.75, 0.15, 0.12))
    return image


def digits(rng: Rng, shape: Shape, colour: Colour) -> Image:
    """Draw a dark display with a time.

    Args:
        rng: Random stream.
        shape: (h, w), px.
        colour: Colour of the digits, sRGB.
    """
    image = shade(plain(shape, (0.06, 0.06, 0.07)), grain(rng, shape), 0.3)
    time = f"{int(rng.integers(10, 24))}:{int(rng.integers(10, 60))}"
    write(image, time, (0.08, 0.15, 0.92, 0.85), colour)
    return image


def newspaper(rng: Rng, shape: Shape) -> Image:
    """Draw a front page: headline, columns and a photograph.

    Args:
        rng: Random stream.
        shape: (h, w), px.
    """
    image = shade(plain(shape, (0.9, 0.88, 0.82)), octaves(rng, shape, (8, 8), 4), 0.06)
    write(image, "THE DAILY", (0.05, 0.03, 0.95, 0.14), BLACK)
    fill(image, (0.05, 0.155, 0.95, 0.165), BLACK)
    for column in range(3):
        left = 0.05 + 0.31 * column
        top = 0.52 if column == 1 else 0.19
        write_lines(image, rng, (left, top, left + 0.27, 0.96), 28 if top < 0.5 else 16, BLACK)
    h, w = shape
    photo = landscape(rng, (round(0.3 * h), round(0.27 * w))).mean(axis=2)
    top, left = round(0.19 * h), round(0.36 * w)
    image[top : top + photo.shape[0], left : left + photo.shape[1]] = photo[:, :, None]
    return image


def card(rng: Rng, shape: Shape) -> Image:
    """Draw a bank card.

    Args:
        rng: Random stream.
        shape: (h, w), px.
    """
    image = shade(plain(shape, ink(rng)), octaves(rng, shape, (4, 4), 4), 0.4)
    fill(image, (0.08, 0.35, 0.24, 0.55), (0.85, 0.72, 0.35))
    write(image, "4929 1306", (0.08, 0.6, 0.92, 0.76), PAPER)
    write(image, "BANK", (0.55, 0.08, 0.93, 0.26), PAPER)
    return image


def carton(rng: Rng, shape: Shape) -> Image:
    """Draw cardboard with tape and a shipping label.

    Args:
        rng: Random stream.
        shape: (h, w), px.
    """
    waves = lattice(rng, shape, (4, shape[1] // 2))
    image = shade(plain(shape, (0.72, 0.55, 0.37)), waves, 0.1)
    image = shade(image, octaves(rng, shape, (6, 6), 4), 0.16)
    fill(image, (0.44, 0.0, 0.56, 1.0), (0.84, 0.74, 0.52))
    fill(image, (0.08, 0.5, 0.4, 0.86), PAPER)
    write_lines(image, rng, (0.11, 0.55, 0.37, 0.82), 6, BLACK)
    write(image, "FRAGILE", (0.6, 0.62, 0.95, 0.8), (0.72, 0.16, 0.14))
    return image


def plate_rings(rng: Rng, shape: Shape, colour: Colour, second: Colour) -> Image:
    """Draw a glaze for a lathe: bands of marks between rings, inside and outside.

    Args:
        rng: Random stream.
        shape: (h, w), px.
        colour: Main colour, sRGB.
        second: Colour of the marks, sRGB.
    """
    down, across = coordinates(shape)
    image = shade(plain(shape, colour), octaves(rng, shape, (6, 6), 4), 0.09)
    band, lines = np.zeros(shape, bool), np.zeros((shape[0], 1), bool)
    for middle in (rng.uniform(0.2, 0.32), rng.uniform(0.66, 0.72)):
        from_middle = np.abs(down - middle)
        band |= (from_middle < 0.05) & (wave(across * 16) > 0.45)
        lines |= np.abs(from_middle - 0.075) < 0.01
    mask = np.broadcast_to(band | lines, shape).astype(np.float32)
    return blend(image, second, mask * 0.9)
