"""Tests of shifts: what stands on an object moves with it, and impossible shifts are rejected."""

from dataclasses import replace

import numpy as np
import pytest
import sim_scenes

from gslts_sim import make_home
from gslts_sim.actions import SceneState, ShiftObject, parse_action
from gslts_sim.changes import MAX_SHIFT_DEG, MAX_SHIFT_M, ChangeError, place, shift, with_carried
from gslts_sim.controller import Controller
from gslts_sim.home import Home, pose
from gslts_sim.physics import problems

TOP_M = 0.75


@pytest.fixture
def home() -> Home:
    """Return a room with a block of 1.2 x 0.8 x 0.75 m on the floor and two mugs on it."""
    return sim_scenes.furnished_home()


def test_what_stands_on_a_block_moves_with_it(home: Home) -> None:
    shifted = shift(home, "Block|1", 0.06, -0.03, 7.0)
    x, y, z = home["Block|1"].world_from_object[:3, 3]
    np.testing.assert_allclose(
        shifted["Block|1"].world_from_object, pose(x + 0.06, y - 0.03, z, np.deg2rad(7.0))
    )
    for name in ("Mug|1", "Mug|2"):
        on_block = [
            np.linalg.inv(state["Block|1"].world_from_object) @ state[name].world_from_object
            for state in (home, shifted)
        ]
        np.testing.assert_allclose(*on_block, atol=1e-9)
        assert shifted[name].parent == "Block|1"
        moved = shifted[name].world_from_object - home[name].world_from_object
        assert 0.01 < np.linalg.norm(moved[:2, 3]) < 0.15
    assert problems(shifted) == []
    assert home["Mug|1"].box_in_world[0, 0] == pytest.approx(2.5), "the home is another value"
    assert shifted["Floor|1"] is home["Floor|1"]


def test_a_table_takes_along_what_stands_on_its_dishes() -> None:
    kitchen = make_home("kitchen", 3, detail=0.05)
    table = next(obj for obj in kitchen.objects if obj.type == "DiningTable")
    assert not table.movable
    carried = with_carried(kitchen, table)
    assert carried[0] is table
    assert any(obj.parent != table.id for obj in carried[1:]), "an apple lies in a bowl"
    shifted = shift(kitchen, table.id, 0.03, 0.02, 2.0)
    assert problems(shifted) == []
    moved = [
        obj.id
        for obj in kitchen.objects
        if not np.array_equal(obj.world_from_object, shifted[obj.id].world_from_object)
    ]
    assert set(moved) == {obj.id for obj in carried}
    motion = shifted[table.id].world_from_object @ np.linalg.inv(table.world_from_object)
    for obj in carried:
        np.testing.assert_allclose(
            shifted[obj.id].world_from_object, motion @ obj.world_from_object, atol=1e-9
        )


@pytest.mark.parametrize(
    ("object_id", "motion", "reason"),
    [
        ("Mug|7", (0.05, 0, 0), r"there is no Mug\|7"),
        ("Wall|1", (0.05, 0, 0), r"Wall\|1 is fixed"),
        ("Floor|1", (0.05, 0, 0), r"Floor\|1 is fixed"),
        ("Block|1", (np.nan, 0, 0), "not finite"),
        ("Block|1", (0, 0, np.inf), "not finite"),
        ("Block|1", (MAX_SHIFT_M, 0.01, 0), "too large: at most 0.15 m"),
        ("Block|1", (0, 0, -MAX_SHIFT_DEG - 1), "too large"),
    ],
)
def test_what_cannot_be_shifted_is_rejected(
    home: Home, object_id: str, motion: tuple[float, float, float], reason: str
) -> None:
    with pytest.raises(ChangeError, match=reason):
        shift(home, object_id, *motion)


def test_a_shift_ends_at_the_next_object_and_at_the_edge(home: Home) -> None:
    beside = place(home, "Mug|1", np.array([2.4, 1.75, TOP_M]))
    with pytest.raises(ChangeError, match=r"Mug\|1 would overlap Mug\|2"):
        shift(beside, "Mug|1", -0.1, 0.0)
    shift(beside, "Mug|1", 0.1, 0.0)
    on_edge = place(home, "Mug|1", np.array([3.14, 1.75, TOP_M]))
    with pytest.raises(ChangeError, match=r"Mug\|1 would not stand on Block\|1 any more"):
        shift(on_edge, "Mug|1", 0.06, 0.0)


def test_what_is_carried_collides_as_well(home: Home) -> None:
    shelf = sim_scenes.box_object(
        "Shelf|1", (2.0, 0.5, 0.8), (3.0, 1.65, 0.85), np.zeros((4, 4, 3), np.uint8)
    )
    low = home.with_object(shelf)
    shift(low, "Block|1", 0.0, 0.1)
    with pytest.raises(ChangeError, match=r"Mug\|1 would overlap Shelf\|1"):
        shift(low, "Block|1", 0.0, -0.1)


def test_fixed_furniture_stands_on_the_floor(home: Home) -> None:
    table = home.with_object(replace(home["Block|1"], movable=False))
    assert problems(shift(table, "Block|1", 0.05, 0.0)) == []
    built_in = home.with_object(replace(home["Mug|1"], movable=False))
    with pytest.raises(ChangeError, match=r"Mug\|1 is fixed"):
        shift(built_in, "Mug|1", 0.05, 0.0)


def test_the_action_shifts_and_respects_the_robot(home: Home) -> None:
    action = parse_action("ShiftObject", {"objectId": "Block|1", "dx": 0.1, "degrees": 3.0})
    assert action == ShiftObject(objectId="Block|1", dx=0.1, degrees=3.0)
    after = SceneState(home).apply(action)
    np.testing.assert_array_equal(
        after.home["Mug|2"].world_from_object,
        shift(home, "Block|1", 0.1, 0.0, 3.0)["Mug|2"].world_from_object,
    )
    robot = Controller(home, width=64, height=48)
    robot.act("Teleport", position={"x": 1.75, "y": 1.9})
    metadata = robot.step("ShiftObject", objectId="Block|1", dx=-0.12).metadata
    assert metadata["errorMessage"] == "ShiftObject: the robot stands in the way"
    assert robot.home is home
    assert robot.step("ShiftObject", objectId="Block|1", dx=0.1).metadata["lastActionSuccess"]
