"""Fusion of depth in numpy, to compare that of the C++ core with."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gslts.core.frame import RgbdFrame

Floats = NDArray[np.float64]
EDGE_SHARE = 0.05
"""A relative step of the depth between neighbours that ends a surface."""


def surface_points(frame: RgbdFrame, step: int) -> Floats:
    """[P,10] points in the world, normals, colours and details of every `step`th pixel."""
    camera = frame.camera
    depth = np.nan_to_num(frame.depth[::step, ::step].astype(np.float64))
    if frame.mask is not None:
        depth[~frame.mask[::step, ::step]] = 0
    rgb = frame.rgb[::step, ::step] / 255.0
    rows, columns = (np.indices(depth.shape) * step) + 0.5
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
    change = np.hypot(*np.gradient(rgb.mean(axis=2)))[1:-1, 1:-1][good] / step
    details = change * camera.fx / middle[good]
    normals = normals @ pose[:3, :3].T
    return np.column_stack([points, normals, rgb[1:-1, 1:-1][good], details])


def fused(
    frames: list[RgbdFrame], voxel_m: float, step: int
) -> dict[tuple[int, ...], tuple[Floats, int]]:
    """Sums as those of `SurfaceVoxels`, and hits, by the place of the voxel in the world's grid."""
    voxels: dict[tuple[int, ...], tuple[Floats, int]] = {}
    for frame in frames:
        points = surface_points(frame, step)
        sums = np.column_stack([np.ones(len(points)), points[:, :9], points[:, 9] ** 2])
        cells = np.floor(points[:, :3] / voxel_m).astype(np.int64)
        unique, inverse = np.unique(cells, axis=0, return_inverse=True)
        for k, cell in enumerate(map(tuple, unique.tolist())):
            before, hits = voxels.get(cell, (np.zeros(11), 0))
            voxels[cell] = (before + sums[inverse == k].sum(axis=0), hits + 1)
    return voxels
