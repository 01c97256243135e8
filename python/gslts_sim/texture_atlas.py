"""Texture atlas with mip levels (Williams 1983) of all surfaces of a home."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gslts.types import Bytes, Floats32
from gslts_sim.mesh import Surface


def linear_from_srgb(values: NDArray[np.floating]) -> NDArray[np.floating]:
    """Convert sRGB to linear light (IEC 61966-2-1).

    Args:
        values: sRGB, 0 to 1.
    """
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def srgb_from_linear(values: NDArray[np.floating]) -> NDArray[np.floating]:
    """Convert linear light to sRGB (IEC 61966-2-1).

    Args:
        values: Linear light, 0 to 1.
    """
    positive = np.maximum(values, 0.0031308)
    return np.where(values <= 0.0031308, 12.92 * values, 1.055 * positive ** (1 / 2.4) - 0.055)


LINEAR_OF_BYTE: Floats32 = linear_from_srgb(np.arange(256) / 255).astype(np.float32)
"""Linear light of each 8-bit sRGB value."""


def texture_atlas(surfaces: Sequence[Surface]) -> dict[str, NDArray[np.generic]]:
    """Build the mip levels of all textures, each half as large as the previous one.

    Args:
        surfaces: Triangles are numbered through all of them, in this order.

    Returns:
        Arguments of `gslts._core.sim.Surfaces`.
    """
    levels: list[Bytes] = []
    of_texture: dict[int, tuple[int, int]] = {}  # By identity: objects share textures.
    first_level, level_count, texels_per_m = [], [], []
    for surface in surfaces:
        key = id(surface.texture)
        if key not in of_texture:
            pyramid = _mip_levels(surface.texture)
            of_texture[key] = len(levels), len(pyramid)
            levels += pyramid
        first, count = of_texture[key]
        first_level.append(np.full(len(surface.faces), first, np.int32))
        level_count.append(np.full(len(surface.faces), count, np.int32))
        texels_per_m.append(_texels_per_m(surface))
    # The three bytes of a texel in one number: one memory access instead of three.
    texels = np.concatenate([level.reshape(-1, 3) for level in levels]).astype(np.uint32)
    return {
        "uvs": np.concatenate([surface.uvs for surface in surfaces]),
        "texels_per_m": np.concatenate(texels_per_m),
        "first_level": np.concatenate(first_level),
        "level_count": np.concatenate(level_count),
        "level_sizes": np.array([level.shape[:2] for level in levels], np.int32),
        "texels": texels[:, 0] | texels[:, 1] << 8 | texels[:, 2] << 16,
    }


def _texels_per_m(surface: Surface) -> Floats32:
    """Return the texel density [F] of each triangle, texels per metre."""
    corners, uvs = surface.vertices[surface.faces], surface.uvs.astype(np.float64)
    height, width = surface.texture.shape[:2]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area_m2 = np.linalg.norm(cross, axis=1)
    (u1, v1), (u2, v2) = (uvs[:, 1] - uvs[:, 0]).T, (uvs[:, 2] - uvs[:, 0]).T
    area_texels = np.abs(u1 * v2 - u2 * v1) * width * height
    density: Floats32 = np.sqrt(area_texels / np.maximum(area_m2, 1e-12)).astype(np.float32)
    return density


def _mip_levels(texture: Bytes) -> list[Bytes]:
    """Return the mip levels of a texture down to one texel, averaged in linear light."""
    levels = [texture]
    linear = LINEAR_OF_BYTE[texture]
    while linear.shape[0] > 1 or linear.shape[1] > 1:
        for axis in (0, 1):
            if linear.shape[axis] > 1:
                even = linear.shape[axis] // 2 * 2
                pairs = np.take(linear, np.arange(even), axis)
                linear = 0.5 * (
                    np.take(pairs, np.arange(0, even, 2), axis)
                    + np.take(pairs, np.arange(1, even, 2), axis)
                )
        levels.append(np.rint(255 * srgb_from_linear(linear)).astype(np.uint8))
    return levels
