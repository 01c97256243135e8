"""Order of Gaussians: a curve through space."""

import numpy as np
from store_maps import random_map

from gslts.mapping.order import morton_codes, sort_by_place


def test_codes_interleave_bits() -> None:
    rng = np.random.default_rng(0)
    cells = rng.integers(0, 1 << 21, (50, 3)).astype(np.uint64)
    for cell, code in zip(cells.tolist(), morton_codes(cells).tolist(), strict=True):
        expected = sum(
            (cell[axis] >> bit & 1) << (3 * bit + axis) for bit in range(21) for axis in range(3)
        )
        assert code == expected


def test_sorting_keeps_the_gaussians_and_brings_neighbours_together() -> None:
    gaussian_map = random_map(5000)
    ordered = sort_by_place(gaussian_map)
    assert ordered.ids.tolist() == list(range(5000))
    assert np.array_equal(np.sort(ordered.means, axis=0), np.sort(gaussian_map.means, axis=0))
    rows = {mean.tobytes(): row for row, mean in enumerate(gaussian_map.means)}
    order = [rows[mean.tobytes()] for mean in ordered.means]
    assert np.array_equal(ordered.sh, gaussian_map.sh[order])

    def steps(means: np.ndarray) -> float:
        return float(np.linalg.norm(np.diff(means, axis=0), axis=1).mean())

    assert steps(ordered.means) < 0.4 * steps(gaussian_map.means)


def test_positions_beyond_the_grid_are_sorted_too() -> None:
    gaussian_map = random_map(3)
    far = gaussian_map.select(np.arange(3))
    assert sort_by_place(far).size == 3
