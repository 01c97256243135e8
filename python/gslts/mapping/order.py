"""Order of the Gaussians of a map: neighbours in space follow each other in the arrays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gslts.core.gaussian_map import GaussianMap
from gslts.types import UInts64

CELL_M, AXIS_BITS = 0.1, 21
"""Edge of the cells that are sorted, m: a chunk of 4096 Gaussians fills many; and bits of a cell's
number along an axis, 200 km."""


def sort_by_place(gaussian_map: GaussianMap) -> GaussianMap:
    """Sort Gaussians along a curve through space, so that chunks of them have small bounds.

    Rendering then skips most of a large map, see `GaussianMap.bounds`.

    Args:
        gaussian_map: Any map.

    Returns:
        The Gaussians by the Morton codes of their cells (Morton 1966), with the ids 0, 1, ...
    """
    middle = 1 << (AXIS_BITS - 1)
    cells = np.floor(gaussian_map.means / CELL_M).clip(-middle, middle - 1).astype(np.int64)
    order = np.argsort(morton_codes((cells + middle).astype(np.uint64)), kind="stable")
    ids = np.arange(gaussian_map.size, dtype=np.uint64)
    return replace(gaussian_map.select(order), ids=ids)


def morton_codes(cells: UInts64) -> UInts64:
    """Interleave the bits of the coordinates of cells.

    Args:
        cells: [N,3] below 2^21.

    Returns:
        [N] codes: bit 3 k + i is bit k of coordinate i.
    """
    spread = cells.copy()
    for shift, mask in (
        (32, 0x1F00000000FFFF),
        (16, 0x1F0000FF0000FF),
        (8, 0x100F00F00F00F00F),
        (4, 0x10C30C30C30C30C3),
        (2, 0x1249249249249249),
    ):
        spread = (spread | (spread << np.uint64(shift))) & np.uint64(mask)
    codes: UInts64 = spread[:, 0] | (spread[:, 1] << np.uint64(1)) | (spread[:, 2] << np.uint64(2))
    return codes
