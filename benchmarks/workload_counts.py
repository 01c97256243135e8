"""Counts what a workload asks of a rasterizer, in NumPy and float64, without the kernels of gslts.

python benchmarks/workload_counts.py S M    # all without names; L takes minutes
"""

from __future__ import annotations

import sys
from dataclasses import dataclass

import numpy as np

from gslts.types import Floats, Ints
from gslts_bench.synthetic_rooms import NEAR_PLANE_M, Room, make_room

# The constants of 3DGS (Kerbl et al. 2023).
ALPHA_MIN = 1 / 255
ALPHA_MAX = 0.99
TRANSMITTANCE_MIN = 1e-4
EPS2D_PX2 = 0.3
JACOBIAN_MARGIN = 0.3
BAND_ROWS = 16
"""Rows of pixels counted at a time: twice as many need twice the memory, with the same counts."""


@dataclass(frozen=True)
class ExpectedCounts:
    """Numbers of visible Gaussians and blends in the experiment that set the targets."""

    visible: float
    blends: float


EXPECTED_COUNTS = {
    "S": ExpectedCounts(29.6e3, 2.03e6),
    "M": ExpectedCounts(109e3, 7.03e6),
    "L": ExpectedCounts(570e3, 23.2e6),
}
"""Counts by workload, of the experiment that set the targets of `targets.py`."""


@dataclass(frozen=True)
class Counts:
    """Visible Gaussians (alpha >= 1/255 in a pixel) and blends before the transmittance ends."""

    visible: int
    blends_per_pixel: Ints


@dataclass(frozen=True)
class Footprints:
    """Projected Gaussians in front of the camera that can reach alpha >= 1/255, nearest first."""

    means2d: Floats
    """[V,2] px"""
    conics: Floats
    """[V,3] inverse covariance, (xx, xy, yy), 1/px^2"""
    opacities: Floats
    """[V]"""
    extents: Floats
    """[V,2] half sizes of the box that holds every pixel with alpha >= 1/255, px"""


def rotation_matrices(quats: Floats) -> Floats:
    """Convert unit quaternions [N,4] wxyz to rotation matrices [N,3,3]."""
    w, x, y, z = (quats / np.linalg.norm(quats, axis=1, keepdims=True)).T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def project(room: Room) -> Footprints:
    """Project all Gaussians of a room (3DGS, Kerbl et al. 2023, eq. 5)."""
    gaussian_map, camera = room.gaussian_map, room.camera
    camera_from_world = np.linalg.inv(camera.world_from_camera)
    rotation = camera_from_world[:3, :3]
    x_in_camera = gaussian_map.means @ rotation.T + camera_from_world[:3, 3]
    opacities = 1 / (1 + np.exp(-gaussian_map.logit_opacities.astype(float)))
    keep = np.flatnonzero((x_in_camera[:, 2] > NEAR_PLANE_M) & (opacities >= ALPHA_MIN))
    keep = keep[np.argsort(x_in_camera[keep, 2], kind="stable")]
    x, y, z = x_in_camera[keep].T
    f, w, h = camera.fx, camera.width, camera.height
    limit_x, limit_y = (1 + JACOBIAN_MARGIN) * w / 2 / f, (1 + JACOBIAN_MARGIN) * h / 2 / f
    jacobian = np.zeros((len(keep), 2, 3))
    jacobian[:, 0, 0] = jacobian[:, 1, 1] = f / z
    jacobian[:, 0, 2] = -f / z * np.clip(x / z, -limit_x, limit_x)
    jacobian[:, 1, 2] = -f / z * np.clip(y / z, -limit_y, limit_y)
    axes = rotation_matrices(gaussian_map.quats[keep].astype(float))
    axes *= np.exp(gaussian_map.log_scales[keep].astype(float))[:, None, :]
    axes2d = jacobian @ rotation @ axes
    covars2d = axes2d @ axes2d.transpose(0, 2, 1) + EPS2D_PX2 * np.eye(2)
    inverses = np.linalg.inv(covars2d)
    reach = 2 * np.log(opacities[keep] / ALPHA_MIN)
    return Footprints(
        means2d=np.stack([f * x / z + w / 2, f * y / z + h / 2], axis=1),
        conics=np.stack([inverses[:, 0, 0], inverses[:, 0, 1], inverses[:, 1, 1]], axis=1),
        opacities=opacities[keep],
        extents=np.sqrt(reach[:, None] * np.stack([covars2d[:, 0, 0], covars2d[:, 1, 1]], axis=1)),
    )


def expand(starts: Ints, ends: Ints) -> tuple[Ints, Ints]:
    """List all integers of the ranges [starts, ends), with the index of the range of each."""
    lengths = np.maximum(ends - starts, 0)
    owners = np.repeat(np.arange(len(starts)), lengths)
    firsts = np.repeat(np.cumsum(lengths) - lengths, lengths)
    return owners, np.arange(lengths.sum()) - firsts + starts[owners]


def blended_pairs(
    splats: Footprints, first_row: int, end_row: int, width: int
) -> tuple[Ints, Ints, Floats]:
    """List splat, pixel and alpha of the pairs with alpha >= 1/255 in rows, nearest first."""
    low = np.ceil(splats.means2d - splats.extents - 0.5).astype(int)
    high = np.floor(splats.means2d + splats.extents - 0.5).astype(int) + 1
    row_starts, row_ends = np.maximum(low[:, 1], first_row), np.minimum(high[:, 1], end_row)
    on_screen = (high[:, 0] > 0) & (low[:, 0] < width)
    splat_of_row, rows = expand(row_starts, np.where(on_screen, row_ends, row_starts))
    starts = np.maximum(low[splat_of_row, 0], 0)
    ends = np.minimum(high[splat_of_row, 0], width)
    row_of_pair, columns = expand(starts, ends)
    splat, row = splat_of_row[row_of_pair], rows[row_of_pair]
    dx = columns + 0.5 - splats.means2d[splat, 0]
    dy = row + 0.5 - splats.means2d[splat, 1]
    xx, xy, yy = splats.conics[splat].T
    alpha = splats.opacities[splat] * np.exp(-0.5 * (xx * dx * dx + yy * dy * dy) - xy * dx * dy)
    keep = alpha >= ALPHA_MIN
    pixel = (row - first_row) * width + columns
    return splat[keep], pixel[keep], np.minimum(alpha[keep], ALPHA_MAX)


def count_blends(pixel: Ints, alpha: Floats, pixels: int) -> Ints:
    """Count the blends of each pixel before its transmittance falls below the minimum."""
    order = np.argsort(pixel, kind="stable")
    pixel, log_left = pixel[order], np.cumsum(np.log1p(-alpha[order]))
    totals = np.bincount(pixel, minlength=pixels)
    firsts = np.cumsum(totals) - totals
    before = np.concatenate([[0.0], log_left])[firsts][pixel]
    return np.bincount(pixel[log_left - before >= np.log(TRANSMITTANCE_MIN)], minlength=pixels)


def count(room: Room) -> Counts:
    """Count visible Gaussians and blends of a room, band by band to bound the memory."""
    splats = project(room)
    visible = np.zeros(len(splats.opacities), bool)
    blends = []
    for first_row in range(0, room.camera.height, BAND_ROWS):
        end_row = min(first_row + BAND_ROWS, room.camera.height)
        splat, pixel, alpha = blended_pairs(splats, first_row, end_row, room.camera.width)
        visible[splat] = True
        blends.append(count_blends(pixel, alpha, (end_row - first_row) * room.camera.width))
    return Counts(int(visible.sum()), np.concatenate(blends))


def report(name: str, counts: Counts, expected: ExpectedCounts) -> str:
    """Format counts beside those of the experiment, in one line."""
    blends = counts.blends_per_pixel
    total = int(blends.sum())
    return (
        f"{name}: visible {counts.visible / 1e3:.1f}k, {expected.visible / 1e3:.1f}k expected "
        f"({counts.visible / expected.visible - 1:+.1%}); "
        f"blends {total / 1e6:.2f}M, {expected.blends / 1e6:.2f}M expected "
        f"({total / expected.blends - 1:+.1%}); "
        f"per pixel mean {blends.mean():.1f}, max {blends.max()}"
    )


if __name__ == "__main__":
    for name in sys.argv[1:] or EXPECTED_COUNTS:
        print(report(name, count(make_room(name)), EXPECTED_COUNTS[name]), flush=True)
