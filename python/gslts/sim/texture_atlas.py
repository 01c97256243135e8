"""All textures of a home in one array, with their smaller versions, for many look-ups at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from gslts.sim.mesh import Surface

Floats32 = NDArray[np.float32]


def linear_from_srgb(values: NDArray[np.floating]) -> NDArray[np.floating]:
    """Linear light of sRGB values, both 0 to 1 (IEC 61966-2-1)."""
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def srgb_from_linear(values: NDArray[np.floating]) -> NDArray[np.floating]:
    """SRGB values of linear light, both 0 to 1 (IEC 61966-2-1)."""
    positive = np.maximum(values, 0.0031308)
    return np.where(values <= 0.0031308, 12.92 * values, 1.055 * positive ** (1 / 2.4) - 0.055)


LINEAR_OF_BYTE: Floats32 = linear_from_srgb(np.arange(256) / 255).astype(np.float32)


class TextureAtlas:
    """Textures with their mip levels (Williams 1983), each half as large as the one before.

    Args:
        surfaces: Their triangles are numbered through, in this order.
    """

    def __init__(self, surfaces: Sequence[Surface]) -> None:
        corners = np.concatenate([surface.uvs for surface in surfaces])
        self._uvs = np.ascontiguousarray(corners.reshape(-1, 6).T)
        levels: list[NDArray[np.uint8]] = []
        first_levels: dict[int, int] = {}  # Of each texture, by identity: objects share them.
        level_counts: list[int] = []
        of_triangle, counts, texels_per_m = [], [], []
        for surface in surfaces:
            key = id(surface.texture)
            if key not in first_levels:
                pyramid = _mip_levels(surface.texture)
                first_levels[key] = len(levels)
                levels += pyramid
                level_counts += [len(pyramid)] * len(pyramid)
            count = len(surface.faces)
            of_triangle.append(np.full(count, first_levels[key]))
            counts.append(np.full(count, level_counts[first_levels[key]]))
            texels_per_m.append(_texels_per_m(surface))
        self._first_level = np.concatenate(of_triangle).astype(np.int32)
        self._level_count = np.concatenate(counts).astype(np.int32)
        self._texels_per_m = np.concatenate(texels_per_m)
        sizes = np.array([level.shape[:2] for level in levels], np.int32)
        self._heights, self._widths = sizes[:, 0], sizes[:, 1]
        ends = np.cumsum(sizes.prod(axis=1), dtype=np.int64)
        self._offsets: NDArray[np.int64] = np.concatenate([np.zeros(1, np.int64), ends[:-1]])
        # The three bytes of a texel in one number, so that one look-up in memory finds them.
        texels = np.concatenate([level.reshape(-1, 3) for level in levels]).astype(np.uint32)
        self._texels = texels[:, 0] | texels[:, 1] << 8 | texels[:, 2] << 16

    def sample(
        self,
        triangles: NDArray[np.integer],
        second: Floats32,
        third: Floats32,
        pixel_m: Floats32,
    ) -> Floats32:
        """Linear colours, interpolated between texels and between levels.

        Args:
            triangles: [...] numbers of the triangles.
            second: [...] barycentric weights of their second corners.
            third: [...] those of their third corners.
            pixel_m: [...] size of a pixel on the surface, m.

        Returns:
            [3,...] float32 in 0 to 1.
        """
        u1, v1, u2, v2, u3, v3 = np.take(self._uvs, triangles, axis=1)
        u = u1 + second * (u2 - u1) + third * (u3 - u1)
        v = v1 + second * (v2 - v1) + third * (v3 - v1)
        texels = np.maximum(pixel_m * np.take(self._texels_per_m, triangles), np.float32(1e-6))
        last = np.take(self._level_count, triangles) - 1
        level = np.clip(np.log2(texels), 0, last.astype(np.float32))
        lower = level.astype(np.int32)
        first = np.take(self._first_level, triangles)
        near = self._bilinear(first + lower, u, v)
        far = self._bilinear(first + np.minimum(lower + 1, last), u, v)
        result: Floats32 = near + (level - np.floor(level)) * (far - near)
        return result

    def _bilinear(self, level: NDArray[np.int32], u: Floats32, v: Floats32) -> Floats32:
        """[3,...] colours of one level at texture coordinates."""
        width, height = np.take(self._widths, level), np.take(self._heights, level)
        half = np.float32(0.5)
        x, y = u * width.astype(np.float32) - half, v * height.astype(np.float32) - half
        column, row = np.floor(x), np.floor(y)
        right, down = x - column, y - row
        left, upper = column.astype(np.int32) % width, row.astype(np.int32) % height
        next_left = np.where(left + 1 == width, 0, left + 1)
        offset = np.take(self._offsets, level)
        rows = [
            offset + upper * width,
            offset + np.where(upper + 1 == height, 0, upper + 1) * width,
        ]
        texels = [[np.take(self._texels, start + c) for c in (left, next_left)] for start in rows]
        result = np.empty((3, *u.shape), np.float32)
        for channel in range(3):
            above, below = (
                _linear(a, channel) + right * (_linear(b, channel) - _linear(a, channel))
                for a, b in texels
            )
            result[channel] = above + down * (below - above)
        return result


def _linear(texels: NDArray[np.uint32], channel: int) -> Floats32:
    return np.take(LINEAR_OF_BYTE, texels >> np.uint32(8 * channel) & np.uint32(255))


def _texels_per_m(surface: Surface) -> Floats32:
    """[F] texels along a metre of each triangle."""
    corners, uvs = surface.vertices[surface.faces], surface.uvs.astype(np.float64)
    height, width = surface.texture.shape[:2]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area_m2 = np.linalg.norm(cross, axis=1)
    (u1, v1), (u2, v2) = (uvs[:, 1] - uvs[:, 0]).T, (uvs[:, 2] - uvs[:, 0]).T
    area_texels = np.abs(u1 * v2 - u2 * v1) * width * height
    density: Floats32 = np.sqrt(area_texels / np.maximum(area_m2, 1e-12)).astype(np.float32)
    return density


def _mip_levels(texture: NDArray[np.uint8]) -> list[NDArray[np.uint8]]:
    """The texture and its halvings down to one texel, averaged in linear light."""
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
