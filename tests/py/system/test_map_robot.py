"""A robot in a map: it sees renderings."""

import numpy as np
import surfel_room
from numpy.testing import assert_allclose

from gslts.core.camera import camera_from_fov, look_at
from gslts.core.robot_body import RobotBody
from gslts.navigation.semantic_map import make_semantic_map
from gslts.robots.in_map import MapRobot

BODY = RobotBody()
CAMERA = camera_from_fov(160, 120, 1.2, look_at((0.5, 1.5, 1.2), (2.0, 1.5, 0.8)))


def robot() -> MapRobot:
    room = surfel_room.surfel_map()
    return MapRobot(room, make_semantic_map(room, BODY), BODY, CAMERA, threads=1)


def test_it_sees_renderings_of_the_map() -> None:
    frame = robot().observe()
    assert frame.rgb.shape == (120, 160, 3)
    assert (frame.depth > 0).mean() > 0.9
    assert_allclose(frame.camera.world_from_camera, CAMERA.world_from_camera)


def test_it_moves_to_free_positions_and_turns() -> None:
    map_robot = robot()
    places = map_robot.reachable_positions()
    assert len(places) > 500
    assert map_robot.move_towards(np.array([0.6, 1.0]), np.pi / 2, 0.3)
    pose = map_robot.observe().camera.world_from_camera
    assert np.linalg.norm(places - pose[:2, 3], axis=1).min() < 1e-9
    assert np.linalg.norm(pose[:2, 3] - (0.6, 1.0)) < 0.05
    assert pose[2, 3] == CAMERA.world_from_camera[2, 3]
    assert_allclose(map_robot.pose(), pose)
    assert_allclose(pose[:3, 2], [0, np.cos(0.3), -np.sin(0.3)], atol=1e-9)
    assert map_robot.move_towards(np.array([0.6, 1.0]), np.pi)  # As far down as before.
    ahead = map_robot.observe().camera.world_from_camera[:3, 2]
    assert_allclose(ahead, [-np.cos(0.3), 0, -np.sin(0.3)], atol=1e-9)


def test_it_does_not_move_without_free_positions() -> None:
    room = surfel_room.surfel_map()
    wide = RobotBody(radius_m=2.0)
    stuck = MapRobot(room, make_semantic_map(room, wide), wide, CAMERA, threads=1)
    assert len(stuck.reachable_positions()) == 0
    assert not stuck.move_towards(np.array([0.6, 1.0]), 0.0)
