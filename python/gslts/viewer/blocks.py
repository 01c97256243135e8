"""Gaussians of a map in blocks, as the page draws them.

A page holds one splat object per block. What a version did not change has blocks of the same
digest, so only the others are sent.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import numpy as np

from gslts.core.gaussian_map import FloatArray, GaussianMap
from gslts.core.spherical_harmonics import colors_in_directions
from gslts.io.activation import unit_quats
from gslts.mapping.density.control import axes_of
from gslts.semantics.clusters import cell_keys
from gslts.types import Bytes, Floats, Indices

BLOCK_M = 0.25
"""Smallest edge of a block, m. A new version sends whole blocks: with larger ones, more beside what
has changed; smaller ones send 1 % of the map less, and are four times as many."""
MAX_BLOCKS, EDGE_STEP = 1500, 2**0.5
"""Above this number of blocks their edge is multiplied by the second value: each is an object of
the page, which takes time and memory there whatever its size."""
UNIT_M = 0.01
"""Unit of covariances and centres on the page, m: covariances are sent as float16, in which a flat
Gaussian of 1 mm would be 0 in m^2."""

Cell = int
"""Key of a cell of the grid, from `cell_keys`."""


@dataclass(frozen=True, eq=False)
class Block:
    """Gaussians whose centres lie in one cell of a grid.

    Attributes:
        centers: [K,3] float32, relative to the origin of the map, in units of `UNIT_M`.
        covariances: [K,3,3] float32, in units of `UNIT_M` squared.
        opacities: [K,1] float32, 0 to 1.
        sh: [K,C,3] spherical harmonics.
        digest: Equal for blocks of equal Gaussians.
    """

    centers: FloatArray
    covariances: FloatArray
    opacities: FloatArray
    sh: FloatArray
    digest: bytes

    @property
    def middle(self) -> Floats:
        """(3,) mean of the centres, relative to the origin of the map, m."""
        middle: Floats = self.centers.mean(axis=0, dtype=np.float64) * UNIT_M
        return middle

    def colors(self, eye: Floats) -> Bytes:
        """Compute the colours that a viewer sees.

        Args:
            eye: (3,) position of the viewer, relative to the origin of the map, m.

        Returns:
            [K,3] uint8, sRGB.
        """
        directions = self.centers * UNIT_M - eye
        colors = colors_in_directions(self.sh, directions)
        bytes_: Bytes = np.rint(255 * colors.clip(0, 1)).astype(np.uint8)
        return bytes_


def make_blocks(gaussian_map: GaussianMap, edge_m: float) -> dict[Cell, Block]:
    """Sort the Gaussians of a map into blocks.

    Args:
        gaussian_map: Any map.
        edge_m: Edge of a block, m, from `block_edge_m`: the same for all versions of a map.

    Returns:
        The blocks by cell.
    """
    axes = axes_of(unit_quats(gaussian_map.quats))
    axes *= np.exp(gaussian_map.log_scales)[:, :, None] / UNIT_M  # An axis per row.
    arrays = (
        (gaussian_map.means / UNIT_M).astype(np.float32),
        np.matmul(axes.transpose(0, 2, 1), axes).astype(np.float32),
        np.exp(-np.logaddexp(0, -gaussian_map.logit_opacities))[:, None].astype(np.float32),
        gaussian_map.sh,
    )
    result = {}
    for cell, rows in rows_by_cell(gaussian_map, edge_m).items():
        centers, covariances, opacities, sh = (np.ascontiguousarray(a[rows]) for a in arrays)
        content = b"".join(a.tobytes() for a in (centers, covariances, opacities, sh))
        digest = hashlib.blake2b(content, digest_size=16).digest()
        result[cell] = Block(centers, covariances, opacities, sh, digest)
    return result


def rows_by_cell(gaussian_map: GaussianMap, edge_m: float) -> dict[Cell, Indices]:
    """Sort Gaussians by the cell of their centres.

    Args:
        gaussian_map: Any map.
        edge_m: Edge of a cell, m.

    Returns:
        Rows of the Gaussians of each cell, ascending.
    """
    keys = cell_keys(gaussian_map.means.astype(np.float64), edge_m)
    order = np.argsort(keys, kind="stable")
    cells, starts = np.unique(keys[order], return_index=True)
    return dict(zip(cells.tolist(), np.split(order, starts)[1:], strict=True))


def block_edge_m(gaussian_map: GaussianMap) -> float:
    """Choose the edge of the blocks of a map.

    Args:
        gaussian_map: The first version that is shown.

    Returns:
        The edge, m.
    """
    edge_m = BLOCK_M
    while len(np.unique(cell_keys(gaussian_map.means.astype(np.float64), edge_m))) > MAX_BLOCKS:
        edge_m *= EDGE_STEP
    return edge_m
