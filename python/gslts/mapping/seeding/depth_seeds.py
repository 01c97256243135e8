"""First Gaussians from depth: flat ones on the surfaces that were measured."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gslts._core.fusion import SurfaceVoxels
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import SH_C0, GaussianMap
from gslts.mapping.density.control import joined
from gslts.types import Floats

PIXEL_STEP = 2
"""Every second pixel each way: neighbours fall into the same voxel anyway."""
LEAST_HITS = 2
"""Frames that must have seen a voxel: what only one saw is mostly noise."""
ALONG, ACROSS = 0.6, 0.2
"""Standard deviations along the surface and across it, in distances to the next Gaussian."""
OPACITY = 0.8
COARSER_LEVELS = 3
"""Plain surfaces get Gaussians of up to 2^3 times the size."""
LEAST_CONTRAST, MOST_CONTRAST = 0.02, 2.0
"""Between no brightness that is ever plain, and any."""
FLAT = 0.97
"""Least length of the mean of unit normals within a voxel, to count as flat: a turn of 20 degrees
between its halves."""


@dataclass(frozen=True, eq=False)
class _Voxels:
    """Sums over the points of voxels, ordered as by `SurfaceVoxels`."""

    keys: NDArray[np.int64]  # Shifted right by 3, that of the voxel of twice the edge around it.
    sums: Floats  # [V,11]: count, point, normal, colour, squared detail

    def select(self, rows: NDArray[np.bool_]) -> _Voxels:
        return _Voxels(self.keys[rows], self.sums[rows])


def seed_from_depth(
    frames: Iterable[RgbdFrame],
    voxel_m: float,
    contrast: float = 0.0,
    *,
    sh_degree: int = 0,
    most: int | None = None,
    least_hits: int = LEAST_HITS,
    pixel_step: int = PIXEL_STEP,
) -> GaussianMap:
    """One Gaussian for each voxel that enough frames measured, larger ones on plain surfaces.

    Args:
        frames: With registered depth, and poses that are roughly right.
        voxel_m: Edge of the smallest voxels.
        contrast: Where colours change by less than this over a voxel of twice, four or eight times
            the edge, and the surface is flat, one Gaussian serves all of it; 0 means nowhere.
        sh_degree: Of the map; all but the constant harmonic start at 0.
        most: If there would be more Gaussians, the contrast is raised, and if that is not enough,
            every so manieth one is left out.
        least_hits: Frames that must have measured a voxel.
        pixel_step: Of every so many rows and columns one is looked at; surfaces narrower than twice
            that are not found.

    Raises:
        ValueError: No voxel was measured so often, or a point is kilometres away.
    """
    voxels = _fused(frames, SurfaceVoxels(voxel_m, pixel_step), least_hits)
    levels = _levels(voxels, voxel_m, contrast)
    while most is not None and _size(levels) > most and contrast < MOST_CONTRAST:
        contrast = max(1.25 * contrast, LEAST_CONTRAST)
        levels = _levels(voxels, voxel_m, contrast)
    *finer, coarsest = (
        _with_edge(level, voxel_m * 2**k, sh_degree) for k, level in enumerate(levels)
    )
    seeds = coarsest
    for part in finer:
        seeds = joined(seeds, part)
    if most is not None and seeds.size > most:
        seeds = seeds.select(np.linspace(0, seeds.size - 1, most).astype(np.int64))
    return seeds


def _fused(frames: Iterable[RgbdFrame], surfaces: SurfaceVoxels, least_hits: int) -> _Voxels:
    """Those that enough frames have seen."""
    for frame in frames:
        mask = None if frame.mask is None else np.ascontiguousarray(frame.mask)
        depth, rgb = np.ascontiguousarray(frame.depth), np.ascontiguousarray(frame.rgb)
        surfaces.add(depth, rgb, frame.camera, mask)
    keys, sums, hits = surfaces.voxels()
    kept = hits >= least_hits
    if not kept.any():
        raise ValueError("seed_from_depth: no surface was measured by enough frames")
    return _Voxels(keys, sums).select(kept)


def _size(levels: list[_Voxels]) -> int:
    return sum(len(level.keys) for level in levels)


def _levels(voxels: _Voxels, voxel_m: float, contrast: float) -> list[_Voxels]:
    """The voxels that become Gaussians, of the given edge, twice, four and eight times that."""
    levels = []
    for k in range(1, COARSER_LEVELS + 1):
        stays, voxels = _split_plain(voxels, voxel_m * 2**k, contrast)
        levels.append(stays)
    return [*levels, voxels]


def _split_plain(voxels: _Voxels, edge_m: float, contrast: float) -> tuple[_Voxels, _Voxels]:
    """Voxels that must stay, and those of the given edge that replace all others."""
    parents = voxels.keys >> 3
    starts = np.flatnonzero(np.diff(parents, prepend=-1))  # The parts of a voxel stand together.
    sums = np.add.reduceat(voxels.sums, starts, axis=0)
    lengths = np.linalg.norm(voxels.sums[:, 4:7], axis=1)
    turning = np.linalg.norm(sums[:, 4:7], axis=1) / np.add.reduceat(lengths, starts)
    detail = np.sqrt(sums[:, 10] / sums[:, 0])
    plain = (detail * edge_m < contrast) & (turning > FLAT)
    stays = np.repeat(~plain, np.diff(starts, append=len(parents)))
    return voxels.select(stays), _Voxels(parents[starts], sums).select(plain)


def _with_edge(voxels: _Voxels, edge_m: float, sh_degree: int) -> GaussianMap:
    sums = voxels.sums
    points, colors = sums[:, 1:4] / sums[:, :1], sums[:, 7:10] / sums[:, :1]
    spacing_m = np.full(len(points), edge_m)
    return flat_gaussians(points, sums[:, 4:7], colors, spacing_m, OPACITY, sh_degree)


def flat_gaussians(
    points: Floats,
    normals: Floats,
    colors: Floats,
    spacing_m: Floats,
    opacity: float,
    sh_degree: int,
) -> GaussianMap:
    """Gaussians that close a surface.

    Args:
        points: [N,3] on it, m.
        normals: [N,3] of any length.
        colors: [N,3] sRGB, 0 to 1.
        spacing_m: [N] distance to the next points.
        opacity: Of all.
        sh_degree: Of the map; all but the constant harmonic are 0.
    """
    size = len(points)
    sh = np.zeros((size, (sh_degree + 1) ** 2, 3), np.float32)
    sh[:, 0] = (colors - 0.5) / SH_C0
    scales_m = spacing_m[:, None] * np.array([ALONG, ALONG, ACROSS])
    return GaussianMap(
        means=points.astype(np.float32),
        quats=_quats_towards(normals).astype(np.float32),
        log_scales=np.log(scales_m).astype(np.float32),
        logit_opacities=np.full(size, np.log(opacity / (1 - opacity)), np.float32),
        sh=sh,
    )


def _quats_towards(normals: Floats) -> Floats:
    """[N,4] wxyz: rotations that turn z to normals of any length."""
    unit = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    quats = np.column_stack([1 + unit[:, 2], -unit[:, 1], unit[:, 0], np.zeros(len(unit))])
    opposite = quats[:, 0] < 1e-6
    quats[opposite] = (0, 1, 0, 0)
    unit_quats: Floats = quats / np.linalg.norm(quats, axis=1, keepdims=True)
    return unit_quats
