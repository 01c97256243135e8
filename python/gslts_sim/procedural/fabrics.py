"""Textures of cloth, rugs, leather, fur and wicker."""

from __future__ import annotations

import numpy as np

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
    tint,
    wave,
)


def weave(rng: Rng, shape: Shape, colour: Colour, second: Colour, threads: int = 64) -> Image:
    """Draw cloth whose warp and weft differ in colour from thread to thread.

    Args:
        rng: Random stream.
        shape: (h, w), px.
        colour: Main colour, sRGB.
        second: Second colour, sRGB.
        threads: Number of threads across.
    """
    down, across = coordinates(shape)
    count = min(threads, shape[0] // 2)
    v, u = np.broadcast_arrays(down * count, across * count)
    row, column = np.floor(v).astype(int), np.floor(u).astype(int)
    over = (row + column) % 2 == 0
    tone = np.where(over, rng.random(count)[row], rng.random(count)[column]).astype(np.float32)
    slub = octaves(rng, shape, (8, 8), 4)
    profile = np.where(over, wave(v + 0.5), wave(u + 0.5)).astype(np.float32)
    image = blend(colour, second, contrast(0.55 * tone + 0.45 * slub, 1.6))
    return shade(image, profile, 0.13)


def pattern(
    rng: Rng, shape: Shape, colour: Colour, second: Colour, third: Colour, motif: int
) -> Image:
    """Draw patterned cloth.

    Args:
        rng: Random stream.
        shape: (h, w), px.
        colour: Main colour, sRGB.
        second: Second colour, sRGB.
        third: Third colour, sRGB.
        motif: 0 for stripes, 1 plaid, 2 dots, 3 zigzag, 4 flowers and 5 leaves in rows.
    """
    down, across = coordinates(shape)
    v, u = np.broadcast_arrays(down, across)
    ground = weave(rng, shape, colour, tint(colour, 0.9), 96)
    if motif == 0:
        first, other = wave(u * 6) > 0.6, wave(u * 6 + 0.5) > 0.92
    elif motif == 1:
        first = (wave(u * 4) > 0.6) ^ (wave(v * 4) > 0.6)
        other = (wave(u * 4 + 0.5) > 0.96) | (wave(v * 4 + 0.5) > 0.96)
    elif motif == 2:
        row = np.floor(v * 8)
        y, x = v * 8 - row - 0.5, (u * 8 + 0.5 * (row % 2)) % 1 - 0.5
        first, other = x * x + y * y < 0.07, x * x + y * y < 0.012
    elif motif == 3:
        ridge = v * 8 + 0.7 * np.abs((u * 6) % 1 - 0.5) * 2
        first, other = ridge % 2 < 0.8, (ridge + 0.6) % 2 < 0.25
    elif motif == 4:
        row = np.floor(v * 4)
        y, x = v * 4 - row - 0.5, (u * 4 + 0.5 * (row % 2)) % 1 - 0.5
        first = np.zeros(shape, bool)
        for px, py in ((0.15, 0.0), (-0.15, 0.0), (0.0, 0.15), (0.0, -0.15)):
            first |= (x - px) ** 2 + (y - py) ** 2 < 0.019
        other = (x * x + y * y < 0.008) | ((np.abs(x - y - 0.4) < 0.03) & (np.abs(x + y) < 0.25))
    else:
        y, x = (v * 6) % 1 - 0.5, (u * 9) % 1 - 0.5
        first = np.abs(x) < 0.42 * (0.25 - y * y) * 4 * (0.4 + 0.6 * (y < 0.1))
        other = np.abs(x) < 0.04
    worn = (0.85 + 0.15 * grain(rng, shape)).astype(np.float32)
    image = blend(ground, shade(plain(shape, second), grain(rng, shape), 0.12), first * worn)
    return blend(image, third, other * worn)


def rug(rng: Rng, shape: Shape, colour: Colour, second: Colour, third: Colour) -> Image:
    """Draw a knotted rug that is symmetric about its middle, with borders and a medallion.

    Args:
        rng: Random stream.
        shape: (h, w), px.
        colour: Main colour, sRGB.
        second: Second colour, sRGB.
        third: Third colour, sRGB.
    """
    h, w = shape
    half = (h // 2, w // 2)
    down, across = coordinates(half)
    v, u = np.broadcast_arrays(down, across)  # The corner is (0, 0), the middle (1, 1).
    aspect = w / h
    to_edge = np.minimum(v, u * aspect)
    x, y = (1 - u) * aspect, 1 - v
    kind = int(rng.integers(3))
    if kind == 0:  # Nested diamonds.
        rings = x + y
        motif = wave(rings * 4)
        fine = wave(x * 14) * wave(y * 14)
    elif kind == 1:  # A field of small lozenges.
        motif = wave((x + y) * 5) * wave((x - y) * 5)
        fine = wave((x + y) * 5 + 0.5) * wave((x - y) * 5 + 0.5)
    else:  # A medallion of eight leaves on a sown field.
        radius = np.sqrt(x * x + y * y)
        petal = (x * x - y * y) ** 2 / np.maximum(radius, 0.02) ** 4
        motif = np.where(radius < 0.35 + 0.4 * petal, wave(radius * 5), 0.0).astype(np.float32)
        fine = wave(x * 8) * wave(y * 8)
    image = blend(colour, second, (motif > 0.6).astype(np.float32))
    image[(motif > 0.42) & (motif < 0.6)] = third
    image[(fine > 0.72) & (motif < 0.3)] = second
    image[fine > 0.93] = third
    beads = (wave(u * 16 * aspect) * wave(v * 16)) > 0.35
    for low, high, ground, ink in ((0.0, 0.07, third, colour), (0.07, 0.2, second, third)):
        band = (to_edge >= low) & (to_edge < high)
        image[band] = ground
        image[band & beads] = ink
    image[(to_edge > 0.2) & (to_edge < 0.225)] = third
    full = np.concatenate([image, image[::-1]])
    full = np.concatenate([full, full[:, ::-1]], axis=1)
    full = np.pad(full, ((0, h - len(full)), (0, w - full.shape[1]), (0, 0)), mode="edge")
    knots = contrast(lattice(rng, shape, (h // 2, w // 2)), 1.5)
    return shade(shade(full, knots, 0.16), octaves(rng, shape, (6, 6), 3), 0.1)


def leather(rng: Rng, shape: Shape, colour: Colour) -> Image:
    """Draw leather: wrinkled cells and worn areas.

    Args:
        rng: Random stream.
        shape: (h, w), px.
        colour: Main colour, sRGB.
    """
    wrinkles = 2 * np.abs(octaves(rng, shape, (24, 24), 2) - 0.5)
    image = shade(plain(shape, colour), contrast(1 - wrinkles, 1.2), 0.16)
    return shade(image, octaves(rng, shape, (3, 3), 3), 0.2)


def fur(rng: Rng, shape: Shape, colour: Colour, second: Colour) -> Image:
    """Draw plush or grass with short strands.

    Args:
        rng: Random stream.
        shape: (h, w), px.
        colour: Main colour, sRGB.
        second: Second colour, sRGB.
    """
    strands = lattice(rng, shape, (shape[0] // 6, shape[1] // 2))
    tufts = octaves(rng, shape, (8, 8), 3)
    return blend(colour, second, contrast(0.6 * strands + 0.4 * tufts, 1.8))


def wicker(rng: Rng, shape: Shape, colour: Colour) -> Image:
    """Draw plaited willow.

    Args:
        rng: Random stream.
        shape: (h, w), px.
        colour: Main colour, sRGB.
    """
    down, across = coordinates(shape)
    v, u = np.broadcast_arrays(down * 16, across * 8)
    over = (np.floor(v) + np.floor(u)) % 2 == 0
    profile = np.where(over, wave(u + 0.5) * 0.6 + 0.4, 0.35) * np.sqrt(wave(v + 0.5))
    image = shade(plain(shape, colour), lattice(rng, shape, (16, 32)), 0.2)
    return image * (0.45 + 0.6 * profile).astype(np.float32)[:, :, None]
