"""Paths by fast marching, against Dijkstra on the same cells."""

import re
import tracemalloc
from itertools import pairwise

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from gslts.core.robot_body import RobotBody
from gslts.navigation.grid import Grid
from gslts.navigation.planner import (
    MAX_START_OFFSET_M,
    NEIGHBOURS,
    distance_field_m,
    free_cells,
    is_line_free,
    plan_path,
)
from gslts.navigation.semantic_map import SemanticMap
from gslts.navigation.terrain import Terrain

CELL_M = 0.05
SIZE = 40


def grid(size: int = SIZE) -> Grid:
    return Grid(np.array([-1.0, 2.0]), CELL_M, size)


def octile_m(free: np.ndarray, goals: np.ndarray) -> np.ndarray:
    """Return [M,M] lengths of shortest paths over eight neighbours, without cutting corners."""
    size = len(free)
    numbers = np.arange(size**2).reshape(size, size)
    starts, ends, lengths = [], [], []
    for i, j in NEIGHBOURS:
        for row, column in np.argwhere(free):
            r, c = row + i, column + j
            if not (0 <= r < size and 0 <= c < size):
                continue
            if free[r, c] and free[row, c] and free[r, column]:
                starts.append(numbers[row, column])
                ends.append(numbers[r, c])
                lengths.append(np.hypot(i, j) * CELL_M)
    graph = coo_matrix((lengths, (starts, ends)), (size**2, size**2)).tocsr()
    found = dijkstra(graph, indices=numbers[goals], min_only=True)
    return np.where(free, found.reshape(size, size), np.inf)


def maze(seed: int) -> np.ndarray:
    """Return rooms in a row with a door each, or random pillars."""
    rng = np.random.default_rng(seed)
    if seed % 2:
        return np.asarray(rng.random((SIZE, SIZE)) > 0.05 * seed)
    free = np.ones((SIZE, SIZE), np.bool_)
    for column in range(4, SIZE, 6):
        free[:, column] = False
        free[rng.integers(1, SIZE - 1) + np.arange(-1, 2), column] = True
    return free


def only(cell: np.ndarray, size: int = SIZE) -> np.ndarray:
    goals = np.zeros((size, size), np.bool_)
    goals[tuple(cell)] = True
    return goals


@pytest.mark.parametrize("seed", range(6))
def test_paths_are_as_short_as_those_of_dijkstra(seed: int) -> None:
    free, rng, where = maze(seed), np.random.default_rng(seed), grid()
    goal = rng.choice(np.argwhere(free))
    expected = octile_m(free, only(goal))
    for cell in rng.permutation(np.argwhere(free))[:40]:
        start = where.centers(cell[None])[0]
        path = plan_path(where, free, start, only(goal))
        octile = expected[tuple(cell)]
        if not np.isfinite(octile):
            assert "there is no path from" in path.reason or "no free floor" in path.reason
            continue
        straight_m = np.linalg.norm(cell - goal) * CELL_M
        assert straight_m - 1e-9 <= path.length_m <= octile + 1e-9
        assert all(
            is_line_free(where, free, first, second) for first, second in pairwise(path.points)
        )
        np.testing.assert_allclose(path.points[0], start)
        np.testing.assert_allclose(path.points[-1], where.centers(goal[None])[0])


@pytest.mark.parametrize("seed", range(6))
def test_the_field_is_that_of_dijkstra(seed: int) -> None:
    free = maze(seed)
    goals = only(np.argwhere(free)[3]) | only(np.argwhere(free)[-3])
    found, expected = distance_field_m(free, goals, CELL_M), octile_m(free, goals)
    np.testing.assert_array_equal(np.isfinite(found), np.isfinite(expected))
    known = np.isfinite(expected) & ~goals
    # An octile path is up to 8 % longer than a straight one; near a goal, fronts are square.
    assert (found[known] > 0.8 * expected[known]).all()
    assert (found[known] < 1.02 * expected[known] + 2 * CELL_M).all()


def test_an_open_floor_is_crossed_straight() -> None:
    free, where = np.ones((SIZE, SIZE), np.bool_), grid()
    start, goal = np.array([-0.9, 2.1]), np.array([37, 20])
    path = plan_path(where, free, start, only(goal))
    end = where.centers(goal[None])[0]
    assert path.length_m == pytest.approx(np.linalg.norm(end - start), rel=1e-3)


def test_the_nearest_of_several_goals_is_taken() -> None:
    free = np.ones((SIZE, SIZE), np.bool_)
    free[:30, 20] = False
    near_but_behind, far = np.array([2, 22]), np.array([2, 3])
    goals = only(near_but_behind) | only(far)
    path = plan_path(grid(), free, grid().centers(np.array([[2, 17]]))[0], goals)
    np.testing.assert_allclose(path.points[-1], grid().centers(far[None])[0])


def test_an_unreachable_goal_has_a_reason() -> None:
    free = np.ones((SIZE, SIZE), np.bool_)
    free[:, 20] = False
    path = plan_path(grid(), free, grid().centers(np.array([[5, 5]]))[0], only(np.array([5, 35])))
    assert len(path.points) == 0
    assert path.length_m == np.inf
    assert re.fullmatch(r"there is no path from \(-0\.7., 2\.2.\) to the goal", path.reason)
    inside = plan_path(grid(), free, grid().centers(np.array([[5, 5]]))[0], only(np.array([5, 20])))
    assert inside.reason == "there is no free cell at the goal"


def test_paths_do_not_pass_between_diagonal_obstacles() -> None:
    free = ~np.eye(8, dtype=np.bool_)
    start = grid(8).centers(np.array([[0, 7]]))[0]
    assert plan_path(grid(8), free, start, only(np.array([7, 0]), 8)).reason
    end = grid(8).centers(np.array([[7, 0]]))[0]
    assert not is_line_free(grid(8), free, start, end)


def test_in_an_obstacle_the_path_begins_at_the_nearest_free_cell() -> None:
    free = np.ones((SIZE, SIZE), np.bool_)
    free[10:20, 10:20] = False
    start = grid().centers(np.array([[15, 11]]))[0]
    path = plan_path(grid(), free, start, only(np.array([15, 35])))
    np.testing.assert_allclose(path.points[0], start)
    np.testing.assert_allclose(path.points[1], grid().centers(np.array([[15, 9]]))[0])
    assert not path.reason


def test_far_from_any_free_cell_there_is_no_path() -> None:
    free = np.zeros((SIZE, SIZE), np.bool_)
    free[:, 35:] = True
    start = grid().centers(np.array([[15, 5]]))[0]
    path = plan_path(grid(), free, start, only(np.array([15, 38])))
    assert path.reason.startswith(f"there is no free floor within {MAX_START_OFFSET_M} m of (-0.7")
    away = plan_path(grid(), free, np.array([90.0, 90.0]), only(np.array([15, 38])))
    assert away.reason.startswith("there is no free floor")


def test_the_path_out_of_an_obstacle_is_not_through_a_wall() -> None:
    free = np.ones((SIZE, SIZE), np.bool_)
    free[:, 18:22] = False
    start = grid().centers(np.array([[15, 18]]))[0]
    assert not plan_path(grid(), free, start, only(np.array([15, 5]))).reason
    assert "there is no path" in plan_path(grid(), free, start, only(np.array([15, 35]))).reason


def test_at_the_goal_the_length_is_zero() -> None:
    free = np.ones((SIZE, SIZE), np.bool_)
    start = grid().centers(np.array([[5, 5]]))[0]
    assert plan_path(grid(), free, start, only(np.array([5, 5]))).length_m == 0
    assert not distance_field_m(free, free, CELL_M).any()


@pytest.mark.parametrize("radius_cells", [1.0, 4.0, 5.5])
def test_free_cells_are_a_radius_away_from_obstacles(radius_cells: float) -> None:
    rng = np.random.default_rng(0)
    obstacles = rng.random((SIZE, SIZE)) < 0.01
    explored = rng.random((SIZE, SIZE)) < 0.9
    found = free_cells(explored, obstacles, radius_cells)
    cells = np.argwhere(np.ones_like(obstacles))
    metres = np.linalg.norm(cells[:, None] - np.argwhere(obstacles), axis=2).min(axis=1)
    expected = explored & (metres >= radius_cells - 1e-6).reshape(SIZE, SIZE)
    np.testing.assert_array_equal(found, expected)
    assert free_cells(explored, np.zeros_like(obstacles), radius_cells).sum() == explored.sum()


@pytest.mark.parametrize("radius_m", [0.0, CELL_M, 0.33, 5.0])
def test_the_cells_of_a_circle_have_their_centres_in_it(radius_m: float) -> None:
    rng = np.random.default_rng(0)
    centers = grid().centers(np.argwhere(np.ones((SIZE, SIZE), np.bool_)))
    positions = np.concatenate([rng.uniform(-2, 5, (100, 2)), centers[::97]])
    for position in positions:
        found = grid().cells_within(position, radius_m).ravel()
        offsets_m = np.linalg.norm(centers - position, axis=1)
        assert found[offsets_m < radius_m - 1e-9].all()
        assert not found[offsets_m > radius_m + 1e-9].any()


def test_blocking_a_position_of_a_large_map_takes_little_memory() -> None:
    layers = np.stack([np.zeros((1000, 1000), np.bool_), np.ones((1000, 1000), np.bool_)])
    known = SemanticMap(Grid(np.zeros(2), CELL_M, 1000), layers, (), 0.0)
    terrain = Terrain(known, RobotBody())
    start, goal = np.array([5.0, 5.0]), np.array([5.2, 5.0])
    assert terrain.is_free([start, goal])
    tracemalloc.start()
    try:
        terrain.block(goal, start)
        assert tracemalloc.get_traced_memory()[1] < 16 * layers[0].size
    finally:
        tracemalloc.stop()
    assert not terrain.is_free([start, goal])
    assert terrain.is_known(np.array([*start, 0.9]))
