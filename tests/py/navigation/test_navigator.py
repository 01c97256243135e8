"""Navigation of a simulated robot in a small room, whose map may be out of date."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import surfel_room

from gslts.core.camera import at_pose
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.navigation.navigator import Navigator
from gslts.navigation.trip import SUCCESS_DISTANCE_M, NavigationResult
from gslts.navigation.walk import MAX_MOVES
from gslts.robots.recorded import RecordedRobot
from gslts.semantics.source import Oracle
from gslts_bench.navigation.truth import Truth, floor_distances_m, succeeds
from gslts_bench.navigation.walker import Walker
from gslts_sim.controller import Controller
from gslts_sim.home import Home
from gslts_sim.robot_body import Viewpoint

START = Viewpoint(0.5, 1.5, 180.0, 0.0)


@cache
def navigator() -> Navigator:
    return navigator_of(surfel_room.surfel_map())


def navigator_of(gaussian_map: GaussianMap) -> Navigator:
    return Navigator(gaussian_map, surfel_room.autoencoder(), Oracle())


def robot_in(home: Home, start: Viewpoint = START, noise: str = "none") -> Walker:
    controller = Controller(home, width=160, height=120, noise=noise)
    controller.go(start)
    return Walker(controller, Truth(home))


def with_box(home: Home, low: surfel_room.Point, high: surfel_room.Point) -> Home:
    return home.with_object(surfel_room.box("Box|2", low, high))


def assert_reached(found: NavigationResult, robot: Walker, home: Home, category: str) -> None:
    assert (found.status, found.reason) == ("reached", "")
    assert succeeds(Truth(home), category, robot.positions[-1], robot.event.instances)
    assert found.distance_m is not None
    assert found.distance_m <= SUCCESS_DISTANCE_M
    np.testing.assert_allclose(found.path[-1], robot.positions[-1], atol=0.03)
    assert found.frame is robot.event.observation


@pytest.mark.parametrize("noise", ["none", "kinect"])
def test_the_robot_goes_to_an_object_and_looks_at_it(noise: str) -> None:
    home = surfel_room.home()
    robot = robot_in(home, noise=noise)
    moves = []
    found = navigator().go(robot, "mug", lambda: moves.append(1))
    assert_reached(found, robot, home, "Mug")
    truth = Truth(home)
    start = int(np.argmin(np.linalg.norm(truth.positions - START.position, axis=1)))
    shortest_m = truth.metres_to(truth.goals("Mug"))[start]
    assert 0 < shortest_m <= robot.length_m <= 1.3 * shortest_m
    assert found.length_m == pytest.approx(robot.length_m, abs=0.3)
    assert len(moves) == len(found.path) - 1


def test_the_nearest_of_several_objects_is_the_target() -> None:
    home = with_box(surfel_room.home(), (3.5, 0.1, 0), (3.9, 0.5, 0.4))
    both = navigator_of(surfel_room.surfels(home))
    for start, expected in (
        (Viewpoint(0.5, 1.0, 0, 0), "Box|1"),
        (Viewpoint(3.5, 1.5, 0, 0), "Box|2"),
    ):
        robot = robot_in(home, start)
        assert_reached(both.go(robot, "Box"), robot, home, "Box")
        assert floor_distances_m(home[expected], robot.positions[-1][None])[0] <= SUCCESS_DISTANCE_M


def test_an_object_that_is_not_in_the_map_is_not_found() -> None:
    robot = robot_in(surfel_room.home())
    found = navigator().go(robot, "Bed")
    assert (found.status, found.reason) == ("not found", "the map has no Bed")
    assert robot.length_m == 0
    with pytest.raises(ValueError, match="expected a name"):
        navigator().go(robot, "  ")


def test_a_removed_object_is_not_found() -> None:
    robot = robot_in(surfel_room.home().without(["Mug|1"]))
    found = navigator().go(robot, "Mug")
    assert (found.status, found.reason) == ("not found", "no Mug is where the map has one")
    assert robot.length_m > 0
    assert len(found.path) < 80


def test_a_flat_removed_object_is_recognized_by_labels() -> None:
    home = surfel_room.home()
    sheet = surfel_room.box("Bed|1", (1.7, 1.0, 0.75), (1.9, 1.2, 0.752))
    old = navigator_of(surfel_room.surfels(home.with_object(sheet)))
    found = old.go(robot_in(home), "Bed")
    assert (found.status, found.reason) == ("not found", "no Bed is where the map has one")
    robot = robot_in(home.with_object(sheet))
    assert_reached(old.go(robot, "Bed"), robot, home.with_object(sheet), "Bed")


def test_without_labels_depth_alone_decides() -> None:
    class Unlabelled(Walker):
        def observe(self) -> RgbdFrame:
            return replace(super().observe(), labels=None)

    for home, status in (
        (surfel_room.home(), "reached"),
        (surfel_room.home().without(["Mug|1"]), "not found"),
    ):
        controller = Controller(home, width=160, height=120)
        controller.go(START)
        assert navigator().go(Unlabelled(controller, Truth(home)), "Mug").status == status


def test_after_a_removed_object_the_next_one_is_the_target() -> None:
    home = with_box(surfel_room.home(), (3.5, 0.1, 0), (3.9, 0.5, 0.4))
    both = navigator_of(surfel_room.surfels(home))
    left = home.without(["Box|1"])
    robot = robot_in(left)
    assert_reached(both.go(robot, "Box"), robot, left, "Box")


def test_the_robot_avoids_obstacles_that_are_not_in_the_map() -> None:
    goal = Viewpoint(3.25, 0.5, 0, 0)
    plain = robot_in(surfel_room.home(), goal)
    assert_reached(navigator().go(plain, "Box"), plain, surfel_room.home(), "Box")
    # The shorter path around the block is blocked.
    home = with_box(surfel_room.home(), (1.2, 0.0, 0), (1.5, 0.9, 1.0))
    blocked = [place for place in plain.positions if place[1] < 0.9]
    assert len(blocked) > 2
    robot = robot_in(home, goal)
    found = navigator().go(robot, "Box")
    assert found.status == "reached"
    assert found.replans >= 1
    assert floor_distances_m(home["Box|1"], robot.positions[-1][None])[0] <= SUCCESS_DISTANCE_M
    assert robot.length_m > plain.length_m


def test_an_enclosed_object_is_unreachable() -> None:
    home = surfel_room.home()
    for number, (low, high) in enumerate(
        [((0.0, 1.2, 0.0), (1.3, 1.3, 1.0)), ((1.3, 1.2, 0.0), (1.4, 3.0, 1.0))]
    ):
        home = home.with_object(surfel_room.box(f"Block|{number + 2}", low, high))
    robot = robot_in(home, Viewpoint(3.25, 0.5, 0, 0))
    found = navigator_of(surfel_room.surfels(home)).go(robot, "Box")
    assert found.status == "unreachable"
    assert found.reason == "the robot has no reachable position within 1 m of any Box"
    assert robot.length_m == 0


def test_a_robot_that_cannot_move_ends_the_trip() -> None:
    class Stuck(Walker):
        def move_towards(self, *_: object) -> bool:
            return False

    home = surfel_room.home()
    controller = Controller(home, width=160, height=120)
    controller.go(START)
    found = navigator().go(Stuck(controller, Truth(home)), "Mug")
    assert found.status in ("unreachable", "lost track")
    assert found.reason
    assert found.length_m == 0
    assert 0 < found.replans <= MAX_MOVES


def test_a_robot_leaves_an_obstacle_that_is_in_the_map_only() -> None:
    home = surfel_room.home()
    stale = with_box(home, (0.2, 1.2, 0), (0.8, 1.8, 0.5)).without(["Box|1"])
    robot = robot_in(home)
    found = navigator_of(surfel_room.surfels(stale)).go(robot, "Mug")
    assert_reached(found, robot, home, "Mug")


def test_a_robot_outside_the_map_has_lost_track() -> None:
    class Elsewhere(Walker):
        def observe(self) -> RgbdFrame:
            frame = super().observe()
            pose = frame.camera.world_from_camera
            pose[:2, 3] += 50
            return replace(frame, camera=at_pose(frame.camera, pose))

    home = surfel_room.home()
    controller = Controller(home, width=160, height=120)
    found = navigator().go(Elsewhere(controller, Truth(home)), "Mug")
    assert found.status == "lost track"
    assert found.reason.startswith("the map has no floor around (5")


def test_a_recording_is_a_robot_too() -> None:
    controller = Controller(surfel_room.home(), width=160, height=120)
    frames = []
    for viewpoint in (START, Viewpoint(1.25, 1.5, 0.0, 30.0)):
        controller.go(viewpoint)
        frames.append(controller.observe())
    found = navigator().go(RecordedRobot(frames), "Mug")
    assert found.status in ("reached", "unreachable", "not found")
    assert found.frame in frames
