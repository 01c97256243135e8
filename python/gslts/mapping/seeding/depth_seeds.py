"""Seeds from depth: flat Gaussians on measured surfaces, larger ones where colours are plain."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from gslts._core.fusion import SurfaceVoxels
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import SH_C0, GaussianMap
from gslts.mapping.density.control import join
from gslts.types import Bools, Floats, Ints

PIXEL_STEP = 2
"""Every 2nd row and column is used: its neighbours fall into the same voxel anyway."""
MIN_HITS = 2
"""Minimum number of frames that measured a voxel: points of a single frame are mostly noise."""
ALONG, ACROSS = 0.6, 0.2
"""Standard deviations along and across the surface, in units of the distance to the next
Gaussian: narrower ones leave gaps, wider ones blur."""
OPACITY = 0.8
"""Opacity of seeds on measured surfaces; below 1, so that gradients can raise and lower it."""
COARSER_LEVELS = 3
"""Levels of coarser voxels: plain surfaces get Gaussians of up to 2^3 times the size."""
MIN_CONTRAST, MAX_CONTRAST = 0.02, 2.0
"""Range of the contrast when it is raised to meet a maximum number of Gaussians: below the first no
surface is plain, above the second all are."""
MIN_FLATNESS = 0.97
"""Minimum length of the mean of unit normals in a voxel that counts as flat: 0.97 is an angle of
about 28 degrees between the normals of two halves."""


class NoSurfaceError(ValueError):
    """No surface was measured by enough frames."""


@dataclass(frozen=True, eq=False)
class _Voxels:
    """Sums over the points in each of V voxels, ordered as by `SurfaceVoxels`."""

    keys: Ints  # [V]; shifted right by 3, the key of the enclosing voxel of twice the edge.
    sums: Floats  # [V,11]: count, point, normal, colour, squared detail

    def select(self, rows: Bools) -> _Voxels:
        return _Voxels(self.keys[rows], self.sums[rows])


def seed_from_depth(
    frames: Iterable[RgbdFrame],
    voxel_m: float,
    contrast: float = 0.0,
    *,
    sh_degree: int = 0,
    max_gaussians: int | None = None,
    min_hits: int = MIN_HITS,
    pixel_step: int = PIXEL_STEP,
) -> GaussianMap:
    """Seed one Gaussian per voxel that enough frames measured, larger ones on plain surfaces.

    Args:
        frames: Registered depth at roughly correct poses.
        voxel_m: Edge of the smallest voxels, m.
        contrast: Colour change (of 1) over a voxel of 2, 4 or 8 times the edge below which a flat
            surface gets a single Gaussian there; 0 means nowhere.
        sh_degree: SH degree of the map; all but the constant coefficients are 0.
        max_gaussians: Maximum number of Gaussians; to meet it, contrast is raised, then Gaussians
            are left out evenly.
        min_hits: Minimum number of frames that measured a voxel.
        pixel_step: Every n-th row and column is used; surfaces narrower than 2 n px are missed.

    Returns:
        float32 map.

    Raises:
        NoSurfaceError: No voxel was measured by enough frames.
        ValueError: A point is kilometres away.
    """
    voxels = _fuse_frames(frames, SurfaceVoxels(voxel_m, pixel_step), min_hits)
    levels = _levels(voxels, voxel_m, contrast)
    while max_gaussians is not None and _size(levels) > max_gaussians and contrast < MAX_CONTRAST:
        contrast = max(1.25 * contrast, MIN_CONTRAST)
        levels = _levels(voxels, voxel_m, contrast)
    *finer, coarsest = (
        _with_edge(level, voxel_m * 2**k, sh_degree) for k, level in enumerate(levels)
    )
    seeds = coarsest
    for part in finer:
        seeds = join(seeds, part)
    if max_gaussians is not None and seeds.size > max_gaussians:
        seeds = seeds.select(np.linspace(0, seeds.size - 1, max_gaussians).astype(np.int64))
    return seeds


def _fuse_frames(frames: Iterable[RgbdFrame], surfaces: SurfaceVoxels, min_hits: int) -> _Voxels:
    """Return the voxels that enough frames have measured."""
    for frame in frames:
        mask = None if frame.mask is None else np.ascontiguousarray(frame.mask)
        depth, rgb = np.ascontiguousarray(frame.depth), np.ascontiguousarray(frame.rgb)
        surfaces.add(depth, rgb, frame.camera, mask)
    keys, sums, hits = surfaces.voxels()
    kept = hits >= min_hits
    if not kept.any():
        raise NoSurfaceError(
            f"seed_from_depth: no surface was measured by {min_hits} frames: check that frames "
            "overlap and that poses and depth have one scale"
        )
    return _Voxels(keys, sums).select(kept)


def _size(levels: list[_Voxels]) -> int:
    return sum(len(level.keys) for level in levels)


def _levels(voxels: _Voxels, voxel_m: float, contrast: float) -> list[_Voxels]:
    """Return the voxels that become Gaussians, of 1, 2, 4 and 8 times the edge."""
    levels = []
    for k in range(1, COARSER_LEVELS + 1):
        stays, voxels = _split_plain(voxels, voxel_m * 2**k, contrast)
        levels.append(stays)
    return [*levels, voxels]


def _split_plain(voxels: _Voxels, edge_m: float, contrast: float) -> tuple[_Voxels, _Voxels]:
    """Split voxels into those that stay, and coarser ones of an edge that replace the others."""
    parents = voxels.keys >> 3
    starts = np.flatnonzero(np.diff(parents, prepend=-1))  # Parts of a voxel are consecutive.
    sums = np.add.reduceat(voxels.sums, starts, axis=0)
    lengths = np.linalg.norm(voxels.sums[:, 4:7], axis=1)
    turning = np.linalg.norm(sums[:, 4:7], axis=1) / np.add.reduceat(lengths, starts)
    detail = np.sqrt(sums[:, 10] / sums[:, 0])
    plain = (detail * edge_m < contrast) & (turning > MIN_FLATNESS)
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
    """Make flat Gaussians that cover a surface.

    Args:
        points: [N,3] on the surface, m.
        normals: [N,3] of any length.
        colors: [N,3] sRGB, 0 to 1.
        spacing_m: [N] distance to the next points, m.
        opacity: Opacity of all.
        sh_degree: SH degree of the map; all but the constant coefficients are 0.

    Returns:
        float32 map.
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
    """Return quaternions [N,4] wxyz that turn z to normals [N,3] of any length."""
    unit = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    quats = np.column_stack([1 + unit[:, 2], -unit[:, 1], unit[:, 0], np.zeros(len(unit))])
    opposite = quats[:, 0] < 1e-6
    quats[opposite] = (0, 1, 0, 0)
    unit_quats: Floats = quats / np.linalg.norm(quats, axis=1, keepdims=True)
    return unit_quats
