"""Queries, routes and trips across the maps of two rooms with two doors."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import surfel_flat
import surfel_room

from gslts.fleet.building import Building
from gslts.fleet.building_edit import add_door, add_room
from gslts.fleet.building_query import BuildingAnswer
from gslts.fleet.building_route import RoutePlanner
from gslts.fleet.building_trip import BuildingTripResult, go_through_building
from gslts.robots.in_frame import RobotInFrame
from gslts_bench.navigation.truth import Truth
from gslts_bench.navigation.walker import Walker
from gslts_sim.controller import Controller
from gslts_sim.home import Home
from gslts_sim.robot_body import Viewpoint

START = Viewpoint(0.5, 0.5, 0.0, 0.0)
IN_KITCHEN = np.array([0.5, 0.5])
NEAR, FAR = surfel_flat.DOORS[1], surfel_flat.DOORS[0]
"""Doors on the shortest route from `START` to the mug, and on the other one."""


@pytest.fixture(scope="module")
def building(tmp_path_factory: pytest.TempPathFactory) -> Building:
    return Building.read(surfel_flat.write_building(tmp_path_factory.mktemp("building")))


@pytest.fixture
def own(tmp_path: Path, building: Building) -> Path:
    """Return the file of a copy of the building."""
    shutil.copytree(Path(building.location).parent, tmp_path / "home")
    return tmp_path / "home" / "building.json"


@pytest.fixture(scope="module")
def mug(building: Building) -> BuildingAnswer:
    return building.query("mug")


def test_objects_are_found_in_the_building_frame(building: Building, mug: BuildingAnswer) -> None:
    (found,) = mug.found
    assert (found.room, mug.without_words, mug.problems) == ("hall", (), {})
    box = surfel_flat.home()["Mug|1"].box_in_world
    np.testing.assert_allclose((found.instance.low, found.instance.high), box, atol=0.03)
    np.testing.assert_allclose(found.instance.corners.mean(axis=0), box.mean(axis=0)[:2], atol=0.03)
    assert building.query("sofa").found == ()
    with pytest.raises(ValueError, match="WORDS: expected the name of an object"):
        building.query(" ")


def test_an_object_seen_through_a_door_is_found_once(building: Building) -> None:
    (box,) = building.query("box").found
    assert box.room == "kitchen"
    (wall, *others) = building.query("wall").found
    assert len({item.room for item in (wall, *others)}) <= 2
    scores = [item.instance.score for item in (wall, *others)]
    assert scores == sorted(scores, reverse=True)


def test_a_route_takes_the_shortest_path_through_doors(
    building: Building, mug: BuildingAnswer
) -> None:
    route = building.plan(mug, IN_KITCHEN, "kitchen")
    kitchen, hall = route.legs
    assert (kitchen.room, kitchen.end, hall.room, hall.end) == (
        "kitchen",
        building.doors[1],
        "hall",
        mug.found[0],
    )
    assert kitchen.length_m == pytest.approx(np.linalg.norm(IN_KITCHEN - NEAR[:2]), rel=0.1)
    np.testing.assert_allclose(kitchen.path[0], IN_KITCHEN)
    np.testing.assert_allclose(kitchen.path[-1], NEAR[:2])
    np.testing.assert_allclose(hall.path[0], NEAR[:2])
    at_mug = surfel_flat.home()["Mug|1"].box_in_world
    nearest = np.clip(hall.path[-1], *at_mug[:, :2])
    assert np.linalg.norm(hall.path[-1] - nearest) < 1
    assert route.length_m == kitchen.length_m + hall.length_m


def test_without_a_door_the_other_one_is_taken(building: Building, mug: BuildingAnswer) -> None:
    planner = RoutePlanner(building, mug)
    shortest = planner.plan(IN_KITCHEN, ["kitchen"])
    planner.exclude(building.doors[1])
    other = planner.plan(IN_KITCHEN, ["kitchen"])
    assert other.legs[0].end == building.doors[0]
    assert other.length_m > shortest.length_m
    planner.exclude(building.doors[0])
    assert planner.plan(IN_KITCHEN, ["kitchen"]).reason.startswith(
        "there is no route from (0.50, 0.50) m to any mug"
    )
    planner.exclude(mug.found[0])
    assert planner.plan(IN_KITCHEN, ["kitchen"]).reason == "the maps have no mug"


def test_the_room_of_a_robot_is_where_its_map_has_floor(
    building: Building, mug: BuildingAnswer
) -> None:
    planner = RoutePlanner(building, mug)
    assert planner.rooms_at(np.array([0.5, 0.5, 1.2])) == ["kitchen"]
    assert planner.rooms_at(np.array([6.0, 1.0, 1.2])) == ["hall"]
    assert planner.rooms_at(np.array([*NEAR[:2], 1.2])) == ["kitchen", "hall"]
    assert planner.rooms_at(np.array([0.5, 0.5, 3.9])) == []
    nowhere = building.plan(mug, np.array([20.0, 0.5, 1.2]))
    assert nowhere.reason.endswith("to any mug: no map has floor there")


def test_a_door_that_the_maps_do_not_reach_is_not_used(own: Path, mug: BuildingAnswer) -> None:
    content = json.loads(own.read_text())
    content["doors"] = [{"rooms": ["kitchen", "hall"], "position_m": [2, -3, 0]}]
    own.write_text(json.dumps(content))
    route = Building.read(own).plan(mug, IN_KITCHEN, "kitchen")
    assert "(2.00, -3.00) m is 3.2" in route.reason
    assert "m from the free floor of kitchen; its nearest point is (" in route.reason


def test_rooms_without_words_or_maps_do_not_stop_the_others(own: Path) -> None:
    surfel_flat.write_map(surfel_room.surfel_map(), own.parent / "cellar", words=False)
    add_room(own, "cellar", str(own.parent / "cellar"))
    shutil.rmtree(own.parent / "kitchen")
    answer = Building.read(own).query("mug")
    assert [item.room for item in answer.found] == ["hall"]
    assert answer.without_words == ("cellar",)
    assert list(answer.problems) == ["kitchen"]
    assert "kitchen: there is no such folder" in answer.problems["kitchen"]
    route = Building.read(own).plan(answer, IN_KITCHEN, "kitchen")
    assert "any mug: kitchen: " in route.reason


def test_a_building_without_words_is_named(tmp_path: Path) -> None:
    surfel_flat.write_map(surfel_room.surfel_map(), tmp_path / "cellar", words=False)
    building = add_room(tmp_path / "building.json", "cellar", str(tmp_path / "cellar"))
    with pytest.raises(ValueError, match="no map has semantic features; gslts semantics adds them"):
        building.query("mug")


def robot_in(home: Home) -> Walker:
    controller = Controller(home, width=160, height=120)
    controller.go(START)
    return Walker(controller, Truth(home))


def go(building: Building, robot: Walker, answer: BuildingAnswer) -> tuple[BuildingTripResult, int]:
    """Return the result, and the number of routes."""
    routes = []
    result = go_through_building(building, answer, robot, on_route=routes.append)
    return result, len(routes)


def test_a_robot_goes_through_a_door(building: Building, mug: BuildingAnswer) -> None:
    robot = robot_in(surfel_flat.home())
    result, routes = go(building, robot, mug)
    assert (result.status, result.reason, routes) == ("reached", "", 1)
    at_mug = surfel_flat.home()["Mug|1"].box_in_world.mean(axis=0)[:2]
    assert np.linalg.norm(robot.positions[-1] - at_mug) < 1.3
    assert result.length_m == pytest.approx(robot.length_m, abs=0.5)
    planned_m = building.plan(mug, IN_KITCHEN, "kitchen").length_m
    assert planned_m - 0.5 < robot.length_m < 1.4 * planned_m


def test_a_blocked_door_leads_to_the_other_one(building: Building, mug: BuildingAnswer) -> None:
    x, y, _ = NEAR
    crate = surfel_room.box("Box|2", (x - 0.8, y - 0.45, 0), (x + 0.8, y + 0.45, 1))
    robot = robot_in(surfel_flat.home().with_object(crate))
    result, routes = go(building, robot, mug)
    assert (result.status, routes) == ("reached", 2)
    assert any(np.linalg.norm(np.array(robot.positions) - FAR[:2], axis=1) < 0.4)


def test_an_object_that_is_gone_is_not_found(building: Building, mug: BuildingAnswer) -> None:
    result, _ = go(building, robot_in(surfel_flat.home().without(["Mug|1"])), mug)
    assert (result.status, result.reason) == (
        "not found",
        "hall: no mug is where the map has one",
    )
    nothing = replace(mug, text="sofa", found=())
    result, routes = go(building, robot_in(surfel_flat.home()), nothing)
    assert (result.status, result.reason, routes) == ("not found", "the maps have no sofa", 0)


def test_a_robot_moves_in_the_frame_of_a_map() -> None:
    robot = Controller(surfel_flat.home(), width=160, height=120)
    robot.go(Viewpoint(5.5, 1.5, 0.0, 0.0))
    building_from_hall = surfel_flat.BUILDING_FROM_HALL
    hall_from_building = np.linalg.inv(building_from_hall)
    in_hall = RobotInFrame(robot, hall_from_building)
    frame, same = in_hall.observe(), robot.observe()
    np.testing.assert_allclose(
        building_from_hall @ frame.camera.world_from_camera, same.camera.world_from_camera
    )
    np.testing.assert_array_equal(frame.rgb, same.rgb)
    corners = in_hall.reachable_positions()
    turn = building_from_hall[:2, :2]
    np.testing.assert_allclose(
        corners @ turn.T + building_from_hall[:2, 3], robot.reachable_positions(), atol=1e-9
    )
    assert in_hall.move_towards(np.array([1.5, 2.0]), 0.3)
    expected = building_from_hall @ np.array([1.5, 2.0, 0, 1])
    np.testing.assert_allclose(robot.pose()[:2, 3], expected[:2], atol=0.18)
    ahead = building_from_hall[:3, :3].T @ robot.pose()[:3, 2]
    assert np.arctan2(ahead[1], ahead[0]) == pytest.approx(0.3, abs=0.05)


def test_doors_are_checked_and_added(own: Path) -> None:
    before = own.read_bytes()
    for rooms, position, message in (
        (("kitchen", "attic"), NEAR, "there is no room attic"),
        (("kitchen", "hall"), (2.0, 1.5, 5.0), "is 5.0 m above the floor of kitchen"),
        (("kitchen", "hall"), (1.0, 1.5, 0.0), "from the free floor of hall; its nearest point"),
    ):
        with pytest.raises(ValueError, match=message):
            add_door(own, rooms, position)
        assert own.read_bytes() == before
    changed = add_door(own, ("hall", "kitchen"), NEAR)
    assert Building.read(own).doors == changed.doors
    assert len(changed.doors) == 3
