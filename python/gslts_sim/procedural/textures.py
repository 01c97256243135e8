"""Textures of natural and woven surfaces, which repeat without seams.

Each function draws an image [h,w,3]; u runs along the grain. Colours are sRGB, 0 to 1.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gslts_sim.procedural.noise import (
    Colour,
    Image,
    Rng,
    Shape,
    blend,
    contrast,
    coordinates,
    grain,
    lattice,
    octaves,
    plain,
    shade,
    wave,
)


def wood(rng: Rng, shape: Shape, dark: Colour, light: Colour) -> Image:
    """Draw sawn wood: bent year rings and fine pores, both along u.

    Args:
        rng: Random stream.
        shape: (h, w), px.
        dark: Colour of the dark parts, sRGB.
        light: Colour of the light parts, sRGB.
    """
    down, _ = coordinates(shape)
    warp = lattice(rng, shape, (3, 1)) + 0.35 * lattice(rng, shape, (7, 3))
    rings = wave(down * 10 + warp * 3)
    fibres = lattice(rng, shape, (max(2, shape[0] // 3), 5))
    pores = contrast(lattice(rng, shape, (shape[0], 24)), 3)
    tone = contrast(0.36 * rings + 0.4 * fibres + 0.24 * octaves(rng, shape, (5, 1), 3), 1.3)
    return shade(blend(dark, light, tone), pores, 0.06)


def painted_wood(rng: Rng, shape: Shape, colour: Colour) -> Image:
    """Draw painted wood: brush marks along u and slight blotches.

    Args:
        rng: Random stream.
        shape: (h, w), px.
        colour: Main colour, sRGB.
    """
    marks = lattice(rng, shape, (max(2, shape[0] // 2), 9))
    blotches = octaves(rng, shape, (6, 6), 4)
    return shade(shade(plain(shape, colour), marks, 0.045), contrast(blotches, 1.5), 0.04)


def planks(rng: Rng, shape: Shape, dark: Colour, light: Colour, rows: int = 8) -> Image:
    """Draw a floor of boards, two per row, each cut from another part of the wood.

    Args:
        rng: Random stream.
        shape: (h, w), px.
        dark: Colour of the dark parts, sRGB.
        light: Colour of the light parts, sRGB.
        rows: Number of rows.
    """
    h, w = shape
    image = wood(rng, shape, dark, light)
    edges = np.round(np.arange(rows + 1) * h / rows).astype(int)
    for top, bottom in pairwise(edges):
        source = int(rng.integers(0, h - (bottom - top) + 1))
        row = np.roll(image[source : source + bottom - top], int(rng.integers(w)), axis=1)
        first, length = int(rng.integers(w)), w // 2 + int(rng.integers(-w // 8, w // 8 + 1))
        tone = np.full(w, rng.uniform(0.82, 1.12), np.float32)
        tone[:length] = rng.uniform(0.82, 1.12)
        row = row * tone[None, :, None]
        joint = max(1, w // 400)
        row[:, :joint] *= 0.45
        row[:, length : length + joint] *= 0.45
        row[: max(1, h // 400)] *= 0.45
        image[top:bottom] = np.roll(row, first, axis=1)
    return image


def herringbone(rng: Rng, shape: Shape, dark: Colour, light: Colour) -> Image:
    """Draw parquet in zigzag: blocks five times as long as wide, laid at right angles.

    Args:
        rng: Random stream.
        shape: (h, w), px.
        dark: Colour of the dark parts, sRGB.
        light: Colour of the light parts, sRGB.
    """
    h, w = shape
    along_u = wood(rng, shape, dark, light)
    along_v = np.ascontiguousarray(wood(rng, (w, h), dark, light).transpose(1, 0, 2))
    unit = w // 20  # A block is 1 x 5 units; the pattern repeats every 10.
    row, column = np.arange(h)[:, None] // unit, np.arange(w)[None, :] // unit
    phase = (column - row) % 10
    level = phase < 5
    start = np.where(level, column - phase, row - (9 - phase))
    block = np.where(level, row * 31 + start * 7, column * 17 + start * 13 + 5) % 97
    tones = rng.uniform(0.8, 1.12, 97).astype(np.float32)
    image: Image = np.where(level[:, :, None], along_u, along_v) * tones[block][:, :, None]
    inner_row, inner_column = np.arange(h)[:, None] % unit, np.arange(w)[None, :] % unit
    line = max(1, unit // 24)
    joint = np.where(
        level,
        (inner_row < line) | ((phase == 0) & (inner_column < line)),
        (inner_column < line) | ((phase == 9) & (inner_row < line)),
    )
    image[joint] *= 0.5
    return image


def tiles(
    rng: Rng,
    shape: Shape,
    colour: Colour,
    second: Colour,
    count: tuple[int, int],
    *,
    bond: bool = False,
    checkered: bool = False,
    joint: Colour = (0.72, 0.7, 0.67),
) -> Image:
    """Draw glazed tiles with joints.

    Args:
        rng: Random stream.
        shape: (h, w), px.
        colour: Colour of the tiles, sRGB.
        second: Colour of their clouds, or of every second tile, sRGB.
        count: Tiles down and across.
        bond: Every second row is shifted by half a tile.
        checkered: The tiles alternate between two colours.
        joint: Colour between the tiles, sRGB.
    """
    down, across = coordinates(shape)
    v, u = np.broadcast_arrays(down * count[0], across * count[1])
    row = np.floor(v).astype(int)
    if bond:
        u = u + np.where(row % 2 == 1, 0.5, 0).astype(np.float32)
    column = np.floor(u).astype(int) % count[1]
    clouds = octaves(rng, shape, (count[0] * 2, count[1] * 2), 4)
    if checkered:
        even = ((row + column) % 2 == 0).astype(np.float32)
        image = shade(blend(second, colour, even), clouds, 0.12)
    else:
        image = blend(colour, second, contrast(clouds, 1.6))
    tones = rng.uniform(-1, 1, (count[0], count[1])).astype(np.float32)
    image = image * (1 + 0.06 * tones[row, column])[:, :, None]
    # Distance to the nearest joint, px.
    to_joint = np.minimum(
        np.minimum(v - row, 1 - (v - row)) * (shape[0] / count[0]),
        np.minimum(u - np.floor(u), 1 - (u - np.floor(u))) * (shape[1] / count[1]),
    )
    width = max(1.0, min(shape[0] / count[0], shape[1] / count[1]) * 0.022)
    rough = shade(plain(shape, joint), grain(rng, shape), 0.12)
    return blend(rough, image, np.clip(to_joint / width - 0.5, 0, 1).astype(np.float32))


def plaster(rng: Rng, shape: Shape, colour: Colour) -> Image:
    """Draw painted plaster: roller marks and faint clouds.

    Args:
        rng: Random stream.
        shape: (h, w), px.
        colour: Main colour, sRGB.
    """
    relief = octaves(rng, shape, (shape[0] // 8, shape[1] // 8), 3, 0.7)
    clouds = octaves(rng, shape, (3, 3), 4)
    image = shade(plain(shape, colour), contrast(relief, 1.5), 0.09)
    return shade(image, clouds, 0.05)


def wallpaper(rng: Rng, shape: Shape, colour: Colour, ink: Colour, motif: int) -> Image:
    """Draw printed paper.

    Args:
        rng: Random stream.
        shape: (h, w), px.
        colour: Main colour, sRGB.
        ink: Colour of the print, sRGB.
        motif: 0 for stripes, 1 sprigs, 2 lattice and 3 medallions.
    """
    down, across = coordinates(shape)
    v, u = np.broadcast_arrays(down, across)
    mask: NDArray[np.floating]
    if motif == 0:
        mask = (wave(u * 8) > 0.5) * 0.75 + (wave(u * 8 + 0.5) > 0.93) * 0.9
    elif motif == 1:
        row = np.floor(v * 6)
        y, x = v * 6 - row - 0.5, (u * 6 + 0.5 * (row % 2)) % 1 - 0.5
        stem = (np.abs(x - 0.3 * y * y) < 0.02) & (np.abs(y) < 0.33)
        petals = np.zeros(shape, bool)
        for px, py in ((0.12, -0.1), (-0.12, -0.02), (0.13, 0.14), (-0.1, 0.2), (0, -0.3)):
            petals |= ((x - px) / 0.1) ** 2 + ((y - py) / 0.055) ** 2 < 1
        mask = (stem | petals) * 0.9
    elif motif == 2:
        mask = np.maximum(wave((u + v) * 5) > 0.92, wave((u - v) * 5) > 0.92) * 0.8
        mask = np.maximum(mask, (wave((u + v) * 5 + 0.5) * wave((u - v) * 5 + 0.5) > 0.9) * 0.9)
    else:
        row = np.floor(v * 4)
        y, x = v * 4 - row - 0.5, (u * 4 + 0.5 * (row % 2)) % 1 - 0.5
        radius = (x * x * 1.7 + y * y) * 4
        mask = ((radius < 0.75) & (wave(radius * 3.2) > 0.5)) * 0.8
    paper = shade(plain(shape, colour), octaves(rng, shape, (32, 32), 3, 0.7), 0.07)
    worn = 0.8 + 0.2 * lattice(rng, shape, (64, 64))
    return blend(paper, ink, mask.astype(np.float32) * worn)


def stone(rng: Rng, shape: Shape, colour: Colour, second: Colour, *, veined: bool) -> Image:
    """Draw marble with veins, or granite with speckles.

    Args:
        rng: Random stream.
        shape: (h, w), px.
        colour: Main colour, sRGB.
        second: Second colour, sRGB.
        veined: Draw marble.
    """
    clouds = octaves(rng, shape, (3, 3), 5)
    if veined:
        vein = np.abs(octaves(rng, shape, (2, 2), 5, 0.6) - 0.5)
        t = np.clip(1 - vein * 16, 0, 1) * 0.8 + contrast(clouds, 1.5) * 0.25
        return shade(blend(colour, second, np.clip(t, 0, 1)), grain(rng, shape), 0.03)
    specks = lattice(rng, shape, (shape[0] // 3, shape[1] // 3))
    t = contrast(0.6 * specks + 0.4 * grain(rng, shape), 3.5)
    return shade(blend(colour, second, t), clouds, 0.12)


def metal(rng: Rng, shape: Shape, colour: Colour) -> Image:
    """Draw brushed metal: long scratches along u.

    Args:
        rng: Random stream.
        shape: (h, w), px.
        colour: Main colour, sRGB.
    """
    scratches = lattice(rng, shape, (shape[0], 6))
    smudges = octaves(rng, shape, (5, 5), 4)
    return shade(shade(plain(shape, colour), scratches, 0.1), smudges, 0.06)


def speckles(rng: Rng, shape: Shape, colour: Colour, second: Colour, share: float) -> Image:
    """Draw a glaze, enamel or skin with dots of a second colour on clouds.

    Args:
        rng: Random stream.
        shape: (h, w), px.
        colour: Main colour, sRGB.
        second: Second colour, sRGB.
        share: Fraction that the dots cover.
    """
    image = shade(plain(shape, colour), octaves(rng, shape, (4, 4), 4), 0.12)
    dots = lattice(rng, shape, (shape[0] // 5, shape[1] // 5))
    edge = np.clip((dots - (1 - share)) * 8, 0, 1)
    return blend(image, second, edge)


def crust(rng: Rng, shape: Shape, colour: Colour, second: Colour) -> Image:
    """Draw the crust or crumb of bread, or potato skin: blotches with bright flecks.

    Args:
        rng: Random stream.
        shape: (h, w), px.
        colour: Main colour, sRGB.
        second: Second colour, sRGB.
    """
    blotches = contrast(octaves(rng, shape, (5, 5), 4, 0.6), 2)
    image = blend(colour, second, blotches)
    flecks = np.clip((lattice(rng, shape, (shape[0] // 4, shape[1] // 4)) - 0.85) * 8, 0, 1)
    return blend(image, (0.96, 0.88, 0.72), 0.7 * flecks)


def fruit_skin(rng: Rng, shape: Shape, colour: Colour, second: Colour) -> Image:
    """Draw fruit skin: one side redder, fine streaks along v, and dots.

    Args:
        rng: Random stream.
        shape: (h, w), px.
        colour: Main colour, sRGB.
        second: Second colour, sRGB.
    """
    flush = octaves(rng, shape, (2, 3), 3)
    streaks = lattice(rng, shape, (3, shape[1] // 3))
    image = blend(colour, second, contrast(0.75 * flush + 0.25 * streaks, 1.8))
    dots = lattice(rng, shape, (shape[0] // 4, shape[1] // 4))
    return blend(image, (0.97, 0.9, 0.7), np.clip((dots - 0.9) * 6, 0, 0.7))


def streaks(rng: Rng, shape: Shape, colour: Colour, second: Colour) -> Image:
    """Draw a leaf: streaks along v.

    Args:
        rng: Random stream.
        shape: (h, w), px.
        colour: Main colour, sRGB.
        second: Second colour, sRGB.
    """
    streaks = octaves(rng, shape, (2, shape[1] // 8), 3, 0.7)
    return blend(colour, second, contrast(streaks, 2))


def bricks(rng: Rng, shape: Shape, colour: Colour, second: Colour) -> Image:
    """Draw a brick wall.

    Args:
        rng: Random stream.
        shape: (h, w), px.
        colour: Main colour, sRGB.
        second: Second colour, sRGB.
    """
    image = tiles(rng, shape, colour, second, (12, 4), bond=True, joint=(0.78, 0.75, 0.7))
    return shade(image, grain(rng, shape), 0.12)
