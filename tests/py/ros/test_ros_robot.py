"""A robot behind topics: goals in the frame of its odometry, for its base."""

import threading
from dataclasses import dataclass, field

import numpy as np
import pytest

from gslts.core.robot import RobotLostError
from gslts.core.se3 import pose_distance
from gslts.ros import robot as robot_module
from gslts.ros.frame_memory import FrameMemory
from gslts.ros.live_poses import mount_matrix
from gslts.ros.robot import RosRobot, yaw_pose

MOUNT = mount_matrix((0.2, 0.05, 0.9, -np.pi / 2, 0.0, -np.pi / 2 + 0.3))
"""Ahead of the middle of the base, and turned to the left."""
MAP_FROM_ODOMETRY = yaw_pose(np.array([3.0, -1.0]), 0.7)


@dataclass
class Base:
    """Drives to each goal at once."""

    pose: np.ndarray = field(default_factory=lambda: yaw_pose(np.array([0.5, 0.2]), 0.1))
    goals: int = 0
    cancelled: int = 0
    is_stuck: bool = False
    is_busy: bool = False
    has_ended: bool = False

    def drive_to(self, position: np.ndarray, yaw_rad: float) -> None:
        if not self.is_stuck:
            self.pose = yaw_pose(position, yaw_rad)
        self.goals += 1

    def cancel(self) -> None:
        self.cancelled += 1

    def tilt_to(self, pitch_rad: float) -> None:
        pass

    def camera(self) -> np.ndarray:
        return self.pose @ MOUNT


def robot_on(base: Base, **changed: object) -> RosRobot:
    return RosRobot(
        **{
            "memory": FrameMemory(),
            "believed_pose": base.camera,
            "base_from_camera": lambda: MOUNT,
            "map_from_odometry": lambda: MAP_FROM_ODOMETRY,
            "newest_s": lambda: 0.0,
            "positions": lambda: np.ones((1, 2)),
            "goals": base,
            "stop": threading.Event(),
            **changed,
        }
    )


def test_the_camera_comes_to_the_goal_in_the_map() -> None:
    base = Base()
    robot = robot_on(base)
    assert robot.move_towards(np.array([1.0, 2.0]), 2.5)
    pose = robot.pose()
    np.testing.assert_allclose(pose[:2, 3], (1.0, 2.0), atol=1e-9)
    assert np.arctan2(pose[1, 2], pose[0, 2]) == pytest.approx(2.5)
    assert pose_distance(pose, MAP_FROM_ODOMETRY @ base.camera())[0] < 1e-9


def test_a_robot_that_is_only_watched_gets_no_goals() -> None:
    robot = robot_on(Base(), goals=None)
    assert not robot.move_towards(np.zeros(2), 0.0)
    assert robot.reachable_positions().shape == (0, 2)


def test_a_robot_that_follows_somebody_else_is_left_alone() -> None:
    base = Base()
    robot = robot_on(base)
    assert len(robot.reachable_positions()) == 1
    robot.leave_alone()
    assert robot.is_left_alone
    assert not robot.move_towards(np.ones(2), 0.0)
    assert base.goals == 0
    assert len(robot.reachable_positions()) == 0


def test_a_robot_without_a_pose_is_lost() -> None:
    def no_pose() -> np.ndarray:
        raise ValueError("there is no pose yet")

    robot = robot_on(Base(), believed_pose=no_pose)
    with pytest.raises(RobotLostError, match="there is no pose yet"):
        robot.move_towards(np.ones(2), 0.0)


def test_a_goal_that_is_given_up_is_cancelled(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(robot_module, "STUCK_S", 0.1)
    base = Base()
    assert robot_on(base).move_towards(np.ones(2), 0.0)
    assert base.cancelled == 0, "it arrived"
    base.is_stuck = True
    assert not robot_on(base).move_towards(np.zeros(2), 0.0)
    assert base.cancelled == 1
    stop = threading.Event()
    stop.set()
    assert not robot_on(base, stop=stop).move_towards(np.zeros(2), 0.0)
    assert base.cancelled == 2
    poses = iter([base.camera()] * 3)
    with pytest.raises(StopIteration):
        robot_on(base, believed_pose=lambda: next(poses)).move_towards(np.zeros(2), 0.0)
    assert base.cancelled == 3


def test_the_goal_of_somebody_else_is_not_cancelled() -> None:
    class Preempted(Base):
        def drive_to(self, *_: object) -> None:
            robot.leave_alone()

    base = Preempted()
    robot = robot_on(base)
    assert not robot.move_towards(np.zeros(2), 0.0)
    assert base.cancelled == 0
