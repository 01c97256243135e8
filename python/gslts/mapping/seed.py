"""First Gaussians from depth: flat ones on the surfaces that were measured."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gslts.frame import RgbdFrame
from gslts.gaussian_map import SH_C0, GaussianMap
from gslts.mapping.density import joined

Floats = NDArray[np.float64]

PIXEL_STEP = 2
"""Every second pixel each way: neighbours fall into the same voxel anyway."""
EDGE_SHARE = 0.05
"""A relative step of the depth between neighbours that ends a surface."""
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
KEY_BITS = 21
"""Of each coordinate of a voxel in a 64-bit key: 2^21 voxels of 1 cm are 20 km."""


@dataclass(frozen=True, eq=False)
class _Voxels:
    """Sums over the points of voxels; `hits` counts frames."""

    keys: NDArray[np.int64]
    sums: Floats  # [V,11]: count, point, normal, colour, squared detail
    hits: NDArray[np.int64]


def seed_from_depth(
    frames: Iterable[RgbdFrame],
    voxel_m: float,
    contrast: float = 0.0,
    *,
    sh_degree: int = 0,
    most: int | None = None,
) -> GaussianMap:
    """One Gaussian for each voxel that at least two frames measured, larger ones on plain surfaces.

    Args:
        frames: With registered depth, and poses that are roughly right.
        voxel_m: Edge of the smallest voxels.
        contrast: Where colours change by less than this over a voxel of twice, four or eight times
            the edge, and the surface is flat, one Gaussian serves all of it; 0 means nowhere.
        sh_degree: Of the map; all but the constant harmonic start at 0.
        most: If there would be more Gaussians, the contrast is raised, and if that is not enough,
            every so manieth one is left out.

    Raises:
        ValueError: No voxel was measured twice.
    """
    voxels = _merged([_voxels_of(frame, voxel_m) for frame in frames])
    kept = voxels.hits >= LEAST_HITS
    if not kept.any():
        raise ValueError("seed_from_depth: no surface was measured by two frames")
    voxels = _Voxels(voxels.keys[kept], voxels.sums[kept], voxels.hits[kept])
    seeds = _gaussians_of(voxels, voxel_m, contrast, sh_degree)
    while most is not None and seeds.size > most and contrast < MOST_CONTRAST:
        contrast = max(1.25 * contrast, LEAST_CONTRAST)
        seeds = _gaussians_of(voxels, voxel_m, contrast, sh_degree)
    if most is not None and seeds.size > most:
        seeds = seeds.select(np.linspace(0, seeds.size - 1, most).astype(np.int64))
    return seeds


def _gaussians_of(voxels: _Voxels, voxel_m: float, contrast: float, sh_degree: int) -> GaussianMap:
    parts, edge_m = [], voxel_m
    for _ in range(COARSER_LEVELS):
        stays, voxels = _split_plain(voxels, 2 * edge_m, contrast)
        parts.append(_with_edge(stays, edge_m, sh_degree))
        edge_m *= 2
    seeds = _with_edge(voxels, edge_m, sh_degree)
    for part in parts:
        seeds = joined(seeds, part)
    return seeds


def _split_plain(voxels: _Voxels, edge_m: float, contrast: float) -> tuple[_Voxels, _Voxels]:
    """Voxels that must stay, and those of the given edge that replace all others."""
    x, y, z = (voxels.keys >> 2 * KEY_BITS, voxels.keys >> KEY_BITS, voxels.keys)
    mask = (1 << KEY_BITS) - 1
    x, y, z = (axis & mask for axis in (x, y, z))
    parents = (x >> 1) << 2 * KEY_BITS | (y >> 1) << KEY_BITS | (z >> 1)
    unique, inverse = np.unique(parents, return_inverse=True)
    sums = np.stack([np.bincount(inverse, column, len(unique)) for column in voxels.sums.T], axis=1)
    lengths = np.linalg.norm(voxels.sums[:, 4:7], axis=1)
    turning = np.linalg.norm(sums[:, 4:7], axis=1) / np.bincount(inverse, lengths, len(unique))
    detail = np.sqrt(sums[:, 10] / sums[:, 0])
    plain = (detail * edge_m < contrast) & (turning > FLAT)
    stays = ~plain[inverse]
    coarser = _Voxels(unique[plain], sums[plain], np.ones(int(plain.sum()), np.int64))
    return _Voxels(voxels.keys[stays], voxels.sums[stays], voxels.hits[stays]), coarser


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


def _voxels_of(frame: RgbdFrame, voxel_m: float) -> _Voxels:
    points, normals, colors, details = surface_points(frame)
    cells = np.floor(points / voxel_m).astype(np.int64) + (1 << (KEY_BITS - 1))
    keys = cells[:, 0] << 2 * KEY_BITS | cells[:, 1] << KEY_BITS | cells[:, 2]
    sums = np.column_stack([np.ones(len(points)), points, normals, colors, details**2])
    return _summed(keys, sums, np.ones(len(keys), np.int64), per_frame=True)


def _merged(several: list[_Voxels]) -> _Voxels:
    return _summed(
        np.concatenate([voxels.keys for voxels in several]),
        np.concatenate([voxels.sums for voxels in several]),
        np.concatenate([voxels.hits for voxels in several]),
        per_frame=False,
    )


def _summed(
    keys: NDArray[np.int64], sums: Floats, hits: NDArray[np.int64], *, per_frame: bool
) -> _Voxels:
    order = np.argsort(keys, kind="stable")
    keys, sums, hits = keys[order], sums[order], hits[order]
    if len(keys) == 0:
        return _Voxels(keys, sums, hits)
    starts = np.flatnonzero(np.concatenate([[True], keys[1:] != keys[:-1]]))
    counted = np.ones(len(starts), np.int64) if per_frame else np.add.reduceat(hits, starts)
    return _Voxels(keys[starts], np.add.reduceat(sums, starts, axis=0), counted)


def surface_points(frame: RgbdFrame) -> tuple[Floats, Floats, Floats, Floats]:
    """Measured points of a frame, with normals and colours.

    Returns:
        points: [P,3] in the world, m.
        normals: [P,3] unit vectors towards the camera.
        colors: [P,3] sRGB, 0 to 1.
        details: [P] change of the brightness along the surface, 1/m.
    """
    camera = frame.camera
    depth = np.nan_to_num(frame.depth[::PIXEL_STEP, ::PIXEL_STEP].astype(np.float64))
    if frame.mask is not None:
        depth[~frame.mask[::PIXEL_STEP, ::PIXEL_STEP]] = 0
    rgb = frame.rgb[::PIXEL_STEP, ::PIXEL_STEP] / 255.0
    rows, columns = (np.indices(depth.shape) * PIXEL_STEP) + 0.5
    x, y = (columns - camera.cx) / camera.fx, (rows - camera.cy) / camera.fy
    in_camera = np.stack([x * depth, y * depth, depth], axis=-1)
    right = in_camera[1:-1, 2:] - in_camera[1:-1, :-2]
    down = in_camera[2:, 1:-1] - in_camera[:-2, 1:-1]
    normals = np.cross(down, right)
    lengths = np.linalg.norm(normals, axis=-1)
    middle = depth[1:-1, 1:-1]
    good = (middle > 0) & (lengths > 0)
    for row, column in ((0, 1), (2, 1), (1, 0), (1, 2)):
        near = depth[row : row + middle.shape[0], column : column + middle.shape[1]]
        good &= (near > 0) & (np.abs(near - middle) < EDGE_SHARE * middle)
    normals = normals[good] / lengths[good, None]
    pose = camera.world_from_camera
    points = in_camera[1:-1, 1:-1][good] @ pose[:3, :3].T + pose[:3, 3]
    change = np.hypot(*np.gradient(rgb.mean(axis=2)))[1:-1, 1:-1][good] / PIXEL_STEP
    details = change * camera.fx / middle[good]
    return points, normals @ pose[:3, :3].T, rgb[1:-1, 1:-1][good], details


def _quats_towards(normals: Floats) -> Floats:
    """[N,4] wxyz: rotations that turn z to normals of any length."""
    unit = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    quats = np.column_stack([1 + unit[:, 2], -unit[:, 1], unit[:, 0], np.zeros(len(unit))])
    opposite = quats[:, 0] < 1e-6
    quats[opposite] = (0, 1, 0, 0)
    unit_quats: Floats = quats / np.linalg.norm(quats, axis=1, keepdims=True)
    return unit_quats
