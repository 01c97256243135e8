"""Walks along planned paths, on floors that are given as grids."""

import numpy as np
import pytest
import surfel_room

from gslts.core.camera import at_pose, camera_from_fov, look_at
from gslts.core.frame import RgbdFrame
from gslts.core.robot_body import RobotBody
from gslts.navigation.grid import Grid
from gslts.navigation.semantic_map import SemanticMap, make_semantic_map
from gslts.navigation.terrain import Terrain
from gslts.navigation.walk import MAX_MOVES, STEP_M, Walk
from gslts.types import Bools, Floats
from gslts_bench.navigation.truth import Truth
from gslts_bench.navigation.walker import Walker
from gslts_sim.controller import Controller
from gslts_sim.robot_body import Viewpoint

CAMERA = camera_from_fov(32, 24, 1.4, np.eye(4))


class Vehicle:
    """A `Robot` that drives straight ahead, `share` of each move, and measures no depth."""

    def __init__(self, position: tuple[float, float], share: float = 1.0) -> None:
        self._position, self._yaw_rad, self._share = np.array(position), 0.0, share

    def pose(self) -> Floats:
        eye = np.array([*self._position, 0.9])
        ahead = np.array([np.cos(self._yaw_rad), np.sin(self._yaw_rad), -0.4])
        return look_at(eye, eye + ahead)

    def observe(self) -> RgbdFrame:
        rgb, depth = np.zeros((24, 32, 3), np.uint8), np.zeros((24, 32), np.float32)
        return RgbdFrame(rgb, depth, at_pose(CAMERA, self.pose()))

    def reachable_positions(self) -> Floats:
        return np.zeros((0, 2))

    def move_towards(
        self, position: Floats, yaw_rad: float, _pitch_rad: float | None = None
    ) -> bool:
        self._position = self._position + self._share * (position - self._position)
        self._yaw_rad = yaw_rad
        return True


def terrain_of(body: RobotBody, obstacles: Bools, explored: Bools) -> Terrain:
    grid = Grid(np.zeros(2), body.radius_m / 4, len(obstacles))
    return Terrain(SemanticMap(grid, np.stack([obstacles, explored]), (), 0.0), body)


def corridor() -> Terrain:
    """Return the floor of a corridor of 80 x 2 m."""
    floor = np.zeros((800, 800), np.bool_)
    floor[:20] = True
    return terrain_of(RobotBody(radius_m=0.4), np.zeros_like(floor), floor)


def test_a_long_corridor_is_driven_to_its_end() -> None:
    walk = Walk(Vehicle((1.0, 1.0)), corridor(), lambda: None)
    end = np.array([79.0, 1.0])
    assert walk.go_near(end) == ""
    assert np.linalg.norm(walk.position - end) < STEP_M


def test_a_walk_without_moves_left_has_not_arrived() -> None:
    terrain = corridor()
    walk = Walk(Vehicle((1.0, 1.0), share=0.25), terrain, lambda: None)
    planned = terrain.plan(walk.position, np.array([79.0, 1.0]))
    assert not walk.follow(planned)
    assert walk.is_over
    allowed = MAX_MOVES + planned.length_m / STEP_M
    assert len(walk.path) - 1 == pytest.approx(allowed, abs=1)
    slow = Walk(Vehicle((1.0, 1.0), share=0.25), terrain, lambda: None)
    assert slow.go_near(np.array([79.0, 1.0])).startswith("the robot did not arrive after 51")


@pytest.mark.parametrize("radius_m", [0.05, 0.1, 0.2, 0.4])
def test_steps_do_not_cut_corners(radius_m: float) -> None:
    cell_m = radius_m / 4
    rows, columns = (np.indices((int(4 / cell_m),) * 2) + 0.5) * cell_m
    wall = (np.abs(columns - 2) <= max(0.05, 0.6 * cell_m)) & (rows < 2.2)
    body = RobotBody(radius_m=radius_m)
    terrain = terrain_of(body, wall, np.ones_like(wall))
    walk = Walk(Vehicle((2 - radius_m - 0.35, 1.5)), terrain, lambda: None)
    path = terrain.plan(walk.position, np.array([2 + radius_m + 0.35, 1.5]))
    assert walk.follow(path)
    assert terrain.is_free(walk.path)
    # It stops at few corners.
    assert len(walk.path) <= path.length_m / STEP_M + len(path.points) + 1


def test_a_new_obstacle_on_the_straight_path_to_a_door_is_avoided_as_soon_as_it_is_seen() -> None:
    body = RobotBody()
    home = surfel_room.home().without(["Block|1", "Mug|1"])
    terrain = Terrain(make_semantic_map(surfel_room.surfels(home), body), body)
    home = home.with_object(surfel_room.box("Box|2", (1.8, 1.2, 0), (2.1, 1.8, 0.8)))
    controller = Controller(home, width=160, height=120, noise="none")
    controller.go(Viewpoint(0.5, 1.5, 0.0, 0.0))
    straight: list[Floats] = []
    walk = Walk(
        Walker(controller, Truth(home)),
        terrain,
        lambda: None if walk.replans else straight.append(walk.position),
    )
    door = np.array([3.5, 1.5])
    assert len(terrain.plan_near(walk.position, door).points) == 2
    assert walk.go_near(door) == ""
    assert walk.replans > 0
    assert np.array(straight)[:, 0].max() < 1.0
