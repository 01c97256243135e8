"""Tests of changes of a home: stability, collisions, rejections and the robot's actions."""

import numpy as np
import pytest
import sim_scenes

from gslts_sim import make_home
from gslts_sim.changes import (
    ChangeError,
    disable,
    draw_place,
    enable,
    place,
    possible_receptacles,
    spawn_randomly,
)
from gslts_sim.controller import Controller
from gslts_sim.home import Home
from gslts_sim.physics import problems

BLOCK_TOP_M = 0.75


@pytest.fixture
def home() -> Home:
    """Return a room with a block of 1.2 x 0.8 x 0.75 m on the floor and two mugs on it."""
    return sim_scenes.furnished_home()


@pytest.fixture
def kitchen() -> Home:
    return make_home("kitchen", 4, detail=0.05)


def test_a_placed_object_stands_at_its_position(home: Home) -> None:
    changed = place(home, "Mug|1", np.array([2.9, 2.1, BLOCK_TOP_M + 0.05]), 90.0)
    mug = changed["Mug|1"]
    np.testing.assert_allclose(mug.world_from_object[:3, 3], [2.9, 2.1, BLOCK_TOP_M])
    np.testing.assert_allclose(mug.world_from_object[:3, 0], [0, 1, 0], atol=1e-12)
    assert mug.parent == "Block|1"
    assert problems(changed) == []
    assert home["Mug|1"].parent == "Block|1"
    assert not np.allclose(home["Mug|1"].world_from_object, mug.world_from_object)


def test_without_a_turn_it_keeps_its_own(home: Home) -> None:
    turned = place(home, "Mug|1", np.array([2.9, 2.1, BLOCK_TOP_M]), 30.0)
    moved = place(turned, "Mug|1", np.array([2.5, 2.1, BLOCK_TOP_M]))
    rotations = [state["Mug|1"].world_from_object[:3, :3] for state in (turned, moved)]
    np.testing.assert_allclose(rotations[0], rotations[1], atol=1e-9)


@pytest.mark.parametrize(
    ("position", "reason"),
    [
        ((2.6, 1.9, 1.2), r"no level face within 0\.1 m below \(2\.6, 1\.9, 1\.2\)"),
        ((1.0, 1.0, -0.5), "no level face"),
        ((3.19, 1.9, BLOCK_TOP_M), r"only \d+ % of Mug\|1 would stand on Block\|1, 60 % must"),
        ((2.25, 1.75, BLOCK_TOP_M), r"Mug\|1 would overlap Mug\|2"),
        ((np.nan, 1.9, BLOCK_TOP_M), "not finite"),
    ],
)
def test_unstable_or_colliding_placements_are_rejected(
    home: Home, position: tuple[float, float, float], reason: str
) -> None:
    with pytest.raises(ChangeError, match=reason):
        place(home, "Mug|1", np.array(position))


def test_only_movable_objects_that_carry_nothing_change(home: Home) -> None:
    with pytest.raises(ChangeError, match=r"there is no Mug\|7"):
        disable(home, "Mug|7")
    with pytest.raises(ChangeError, match=r"Wall\|1 is not movable"):
        disable(home, "Wall|1")
    with pytest.raises(ChangeError, match=r"Mug\|1 stands on Block\|1"):
        disable(home, "Block|1")


def test_a_removed_object_returns_if_its_pose_is_free(home: Home) -> None:
    mug = home["Mug|1"]
    without = disable(home, "Mug|1")
    assert "Mug|1" not in without
    back = enable(without, mug)
    np.testing.assert_array_equal(back["Mug|1"].world_from_object, mug.world_from_object)
    with pytest.raises(ChangeError, match=r"Mug\|1 is there already"):
        enable(back, mug)
    x, y, _ = mug.world_from_object[:3, 3]
    taken = place(without, "Mug|2", np.array([x, y, BLOCK_TOP_M]))
    with pytest.raises(ChangeError, match=r"Mug\|1 would overlap Mug\|2"):
        enable(taken, mug)
    empty = disable(disable(without, "Mug|2"), "Block|1")
    with pytest.raises(ChangeError, match=r"Mug\|1 stood on Block\|1, which is not there"):
        enable(empty, mug)


def test_a_lamp_takes_its_light_along() -> None:
    home = sim_scenes.furnished_home(lamp="Mug|1")
    first, of_lamp = home.all_lights
    assert (first.owner, of_lamp.owner) == (None, "Mug|1")
    without = disable(home, "Mug|1")
    assert [light.owner for light in without.all_lights] == [None]
    back = enable(without, home["Mug|1"])
    np.testing.assert_array_equal(back.all_lights[1].center, of_lamp.center)
    moved = place(home, "Mug|1", np.array([2.9, 2.1, BLOCK_TOP_M]), 90.0).all_lights[1]
    shift = moved.center - (2.9, 2.1, BLOCK_TOP_M)
    np.testing.assert_allclose(shift, of_lamp.center - (2.55, 1.75, BLOCK_TOP_M), atol=1e-9)
    assert abs(moved.edge_u @ of_lamp.edge_u) < 1e-9, "a quarter turn"


def test_random_spawns_are_sound_and_repeat(kitchen: Home) -> None:
    spawned = spawn_randomly(kitchen, 3)
    assert problems(spawned) == []
    assert {obj.id for obj in spawned.objects} == {obj.id for obj in kitchen.objects}
    moved = [
        obj.id
        for obj in kitchen.objects
        if not np.array_equal(obj.world_from_object, spawned[obj.id].world_from_object)
    ]
    assert len(moved) > 10
    assert all(kitchen[name].movable for name in moved)
    again, other = spawn_randomly(kitchen, 3), spawn_randomly(kitchen, 4)
    for obj in spawned.objects:
        np.testing.assert_array_equal(obj.world_from_object, again[obj.id].world_from_object)
    assert any(
        not np.array_equal(obj.world_from_object, other[obj.id].world_from_object)
        for obj in spawned.objects
    )


def test_sampled_placements_repeat_as_a_script_writes_them(kitchen: Home) -> None:
    rng = np.random.default_rng(0)
    drawn = 0
    for obj in kitchen.objects:
        if not obj.movable or any(other.parent == obj.id for other in kitchen.objects):
            continue
        receptacles = possible_receptacles(kitchen, obj)
        placement = draw_place(kitchen, obj, receptacles[rng.integers(len(receptacles))], rng)
        if placement is None:
            continue
        drawn += 1
        replayed = place(kitchen, obj.id, placement.position, placement.yaw_deg)
        assert problems(replayed) == []
        np.testing.assert_array_equal(
            replayed[obj.id].world_from_object, placement.home[obj.id].world_from_object
        )
    assert drawn >= 10


def test_large_objects_stay_on_the_floor(kitchen: Home) -> None:
    chair, mug = kitchen["Chair|1"], kitchen["Mug|1"]
    assert {other.type for other in possible_receptacles(kitchen, chair)} <= {"Floor", "Rug"}
    assert "DiningTable" in {other.type for other in possible_receptacles(kitchen, mug)}


def step(controller: Controller, action: str, **arguments: object) -> tuple[bool, str]:
    metadata = controller.step(action, **arguments).metadata
    assert metadata["lastAction"] == action
    return metadata["lastActionSuccess"], metadata["errorMessage"]


def test_actions_change_the_view_of_the_robot(home: Home) -> None:
    controller = Controller(home, width=64, height=48)
    colors = dict(controller.last_event.color_to_object_id)
    place_of_robot = {"x": 1.25, "y": 2.0}
    assert step(controller, "Teleport", position=place_of_robot, rotation=0.0, horizon=30.0)[0]
    assert "Mug|1" in controller.last_event.instance_masks
    assert step(controller, "DisableObject", objectId="Mug|1") == (True, "")
    event = controller.last_event
    assert "Mug|1" not in event.instance_masks
    assert "Mug|1" not in {obj["objectId"] for obj in event.metadata["objects"]}
    assert event.color_to_object_id == colors
    assert step(controller, "EnableObject", objectId="Mug|1") == (True, "")
    assert "Mug|1" in controller.last_event.instance_masks
    point = {"x": 2.9, "y": 2.1, "z": BLOCK_TOP_M}
    assert step(controller, "PlaceObjectAtPoint", objectId="Mug|1", position=point) == (True, "")
    by_id = {obj["objectId"]: obj for obj in controller.last_event.metadata["objects"]}
    assert by_id["Mug|1"]["position"] == pytest.approx(point)
    assert step(controller, "InitialRandomSpawn", randomSeed=1) == (True, "")
    assert problems(controller.home) == []


def test_rejected_actions_say_why_and_change_nothing(home: Home) -> None:
    controller = Controller(home, width=64, height=48)
    assert step(controller, "DisableObject", objectId="Block|1") == (
        False,
        "DisableObject: Mug|1 stands on Block|1",
    )
    assert step(controller, "EnableObject", objectId="Mug|1") == (
        False,
        "EnableObject: Mug|1 is there already",
    )
    assert step(controller, "EnableObject", objectId="Mug|9")[1].endswith("Mug|9 was never there")
    at_robot = {**controller.last_event.metadata["agent"]["position"], "z": 0.0}
    assert step(controller, "PlaceObjectAtPoint", objectId="Mug|1", position=at_robot) == (
        False,
        "PlaceObjectAtPoint: the robot stands in the way",
    )
    assert controller.home is home
    with pytest.raises(ValueError, match=r"PlaceObjectAtPoint: position\.z: Field required"):
        controller.step("PlaceObjectAtPoint", objectId="Mug|1", position={"x": 1, "y": 1})
