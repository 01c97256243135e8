"""Small systems and products of matrices are computed in one order on every processor."""

import numpy as np
import pytest

from gslts.core.camera import look_at
from gslts.core.se3 import inverse_transform, product, relative, transform
from gslts.localization.alignment import solve_positive

RNG = np.random.default_rng(3)
POSES = [look_at(RNG.uniform(-2, 2, 3), RNG.uniform(3, 5, 3)) for _ in range(2)]


@pytest.mark.parametrize("size", [1, 6, 10])
@pytest.mark.parametrize("columns", [None, 3])
def test_positive_systems_are_solved(size: int, columns: int | None) -> None:
    root = RNG.normal(size=(size, size))
    matrix = root @ root.T + 0.1 * np.eye(size)
    right = RNG.normal(size=size if columns is None else (size, columns))
    given = matrix.copy(), right.copy()
    np.testing.assert_allclose(matrix @ solve_positive(matrix, right), right, atol=1e-10)
    np.testing.assert_array_equal(matrix, given[0])
    np.testing.assert_array_equal(right, given[1])


def test_undetermined_unknowns_stay_zero() -> None:
    rows = RNG.normal(size=(4, 6))
    matrix, right = rows.T @ rows, rows.T @ RNG.normal(size=4)
    found = solve_positive(matrix, right)
    np.testing.assert_allclose(matrix @ found, right, atol=1e-10)
    assert np.count_nonzero(found) == 4
    np.testing.assert_array_equal(solve_positive(np.zeros((3, 3)), np.zeros(3)), np.zeros(3))


@pytest.mark.parametrize("shape", [(3,), (7, 3), (2, 5, 3), (0, 3)])
def test_points_are_transformed_and_back(shape: tuple[int, ...]) -> None:
    pose, points = POSES[0], RNG.normal(size=shape)
    there = transform(pose, points)
    np.testing.assert_allclose(there, points @ pose[:3, :3].T + pose[:3, 3], atol=1e-12)
    np.testing.assert_allclose(inverse_transform(pose, there), points, atol=1e-12)


def test_relative_poses_are_products_with_an_inverse() -> None:
    first, second = POSES
    np.testing.assert_allclose(
        relative(first, second), np.linalg.inv(first) @ second, rtol=0, atol=1e-12
    )
    np.testing.assert_allclose(product(first, second), first @ second, rtol=0, atol=1e-12)
