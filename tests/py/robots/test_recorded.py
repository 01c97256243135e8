"""A recorded data set as a robot."""

from dataclasses import replace

import numpy as np
import pytest
import sim_scenes

from gslts.core.robot import Robot
from gslts.robots.driving import go_to
from gslts.robots.recorded import RecordedRobot
from gslts_sim.controller import Controller


@pytest.fixture(scope="module")
def visit() -> list:
    """Return frames at two positions, in four directions each."""
    robot = Controller(sim_scenes.simple_home(), width=32, height=24)
    frames = []
    for x in (1.0, 4.0):
        for yaw in (0.0, 90.0, 180.0, 270.0):
            robot.act("Teleport", position={"x": x, "y": 1.0}, rotation=yaw)
            frames.append(robot.observe())
    return frames


def test_it_moves_to_the_frame_with_the_nearest_position_and_direction(visit: list) -> None:
    robot: Robot = RecordedRobot(visit)
    assert robot.observe() is visit[0]
    np.testing.assert_allclose(robot.reachable_positions(), [[1.0, 1.0], [4.0, 1.0]])
    for number, (position, yaw_rad) in {
        6: ((4.2, 1.1), np.pi),
        2: ((0.8, 1.3), -np.pi + 0.2),
        5: ((3.7, 0.8), np.pi / 2 + 2 * np.pi),
    }.items():
        assert robot.move_towards(np.array(position), yaw_rad)
        assert robot.observe() is visit[number]
        np.testing.assert_array_equal(robot.pose(), visit[number].camera.world_from_camera)


def test_among_frames_at_one_position_the_pitch_decides() -> None:
    robot = Controller(sim_scenes.simple_home(), width=32, height=24)
    frames = []
    for horizon in (-30.0, 0.0, 30.0):
        robot.act("Teleport", position={"x": 1.0, "y": 1.0}, rotation=90.0, horizon=horizon)
        frames.append(robot.observe())
    recorded = RecordedRobot(frames)
    for number, pitch_rad in ((0, -0.4), (1, 0.1), (2, 0.5)):
        assert recorded.move_towards(np.array([1.0, 1.0]), np.pi / 2, pitch_rad)
        assert recorded.observe() is frames[number]


def test_a_standing_camera_gives_each_frame_in_turn(visit: list) -> None:
    standing = [replace(visit[0], time_s=float(second)) for second in range(3)]
    recorded = RecordedRobot([*standing, visit[5]])
    for frame in (standing[0], standing[1], visit[5], standing[2], *standing):
        assert go_to(recorded, frame.camera)
        assert recorded.observe() is frame
        assert recorded.observe() is frame


def test_no_frames_are_rejected() -> None:
    with pytest.raises(
        ValueError, match="RecordedRobot: frames: expected at least one frame, got none"
    ):
        RecordedRobot([])
