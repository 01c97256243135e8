"""Tests of the floor grid in homes of several rooms."""

import numpy as np
import pytest
from flats import bare_flat

from gslts_sim.home import Home
from gslts_sim.walkable import WalkableFloor, walkable_floor

L_SHAPE = (0, 0, 5, 2), (0, 2, 2, 5)
DIAGONAL = (0, 0, 3, 3), (4, 4, 7, 7)


def floor_of(home: Home) -> WalkableFloor:
    return walkable_floor(home, home.space)


def rooms_of(home: Home, positions: np.ndarray) -> np.ndarray:
    """Return the number [P] of the room around each position; -1 for none."""
    numbers = np.full(len(positions), -1)
    for k, room in enumerate(home.rooms):
        inside = (room.box[0, :2] <= positions) & (positions <= room.box[1, :2])
        numbers[inside.all(axis=1)] = k
    return numbers


def test_l_shaped_flat_ends_at_its_rooms():
    home = bare_flat(*L_SHAPE)
    floor = floor_of(home)
    positions = floor.grid_positions(0.05)
    assert set(rooms_of(home, positions)) == {0, 1}
    assert floor.free.sum() * 0.05**2 == pytest.approx(16)
    # 0.2 m from the outline, and round at the inner corner.
    area = 16 - 0.2 * 20 + 5 * 0.04 - 0.04 * np.pi / 4
    assert floor.standing.sum() * 0.05**2 == pytest.approx(area, rel=0.02)
    corner = np.array([2.0, 2.0])
    assert np.linalg.norm(positions - corner, axis=1).min() == pytest.approx(0.2, abs=0.05)
    assert not floor.is_free(np.array([3.5, 3.5]))


@pytest.mark.parametrize(("opening_m", "joined"), [(0.9, True), (0.35, False)])
def test_rooms_on_both_sides_of_a_door(opening_m, joined):
    start, end = 1.5 - opening_m / 2, 1.5 + opening_m / 2
    walls = (3, 0, 3.12, start), (3, end, 3.12, 3)
    home = bare_flat((0, 0, 3, 3), (3.12, 0, 6.12, 3), blocks=walls)
    floor = floor_of(home)
    assert floor.is_free(np.array([3.05, 1.5])) == joined
    assert not floor.is_free(np.array([3.05, 0.3]))
    assert set(rooms_of(home, floor.grid_positions(0.25))) >= ({0, 1} if joined else {0})
    for start_x, others in ((1.0, 5.0), (5.0, 1.0)):
        part = floor.grid_positions(0.25, np.array([start_x, 1.5]))
        assert (np.abs(part[:, 0] - start_x) < 0.3).any()
        assert (np.abs(part[:, 0] - others) < 0.3).any() == joined


@pytest.mark.parametrize(("gap_m", "joined"), [(0.3, True), (0.5, False)])
def test_how_thick_a_wall_may_be(gap_m, joined):
    home = bare_flat((0, 0, 3, 3), (0, 3 + gap_m, 3, 6 + gap_m))
    floor = floor_of(home)
    assert floor.is_free(np.array([1.5, 3 + gap_m / 2])) == joined
    assert len(np.unique(rooms_of(home, floor.grid_positions(0.25)))) == (3 if joined else 1)


def test_diagonal_rooms_are_apart():
    home = bare_flat(*DIAGONAL)
    floor = floor_of(home)
    assert set(rooms_of(home, floor.grid_positions(0.25))) in ({0}, {1})
    for k, middle in enumerate(([1.5, 1.5], [5.5, 5.5])):
        assert floor.is_free(np.array(middle))
        positions = floor.grid_positions(0.25, np.array(middle))
        assert len(positions) > 100
        assert set(rooms_of(home, positions)) == {k}


def test_reachable_component_of_a_position():
    floor = floor_of(bare_flat((0, 0, 3, 3), (4, 4, 6, 6)))
    larger, smaller = (floor.reachable_from(np.array([x, x])) for x in (1.0, 5.0))
    np.testing.assert_array_equal(larger, floor.largest)
    np.testing.assert_array_equal(larger | smaller, floor.standing)
    assert not (larger & smaller).any()
    assert not floor.can_stand(np.array([5.0, 5.0]))
    np.testing.assert_array_equal(
        floor.grid_positions(0.25, np.array([1.0, 1.0])), floor.grid_positions(0.25)
    )


@pytest.mark.parametrize(
    "position", [(3.5, 3.5), (0.1, 1), (-50, 1), (np.nan, 1), (1e300, -np.inf)]
)
def test_a_blocked_position_reaches_nothing(position):
    floor = floor_of(bare_flat(*DIAGONAL))
    assert not floor.is_free(np.array(position))
    assert not floor.reachable_from(np.array(position)).any()
    assert floor.grid_positions(0.25, np.array(position)).shape == (0, 2)


def test_only_rooms_as_low_as_the_lowest_have_floor():
    home = bare_flat((0, 0, 3, 3), (3, 0, 6, 3))
    home.rooms[1].box[:, 2] += 2.6
    assert set(rooms_of(home, floor_of(home).grid_positions(0.25))) == {0}
