"""A robot behind ROS topics: frames of its camera, and goals for its own navigation."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from gslts.core.frame import RgbdFrame
from gslts.core.robot import RobotLostError
from gslts.core.se3 import pose_distance
from gslts.datasets.dataset import rigid
from gslts.ros.constants import (
    ARRIVED_M,
    ARRIVED_RAD,
    FOREIGN_GOAL_S,
    GOAL_TIMEOUT_S,
    OBSERVE_TIMEOUT_S,
    STILL_M,
    STILL_RAD,
    STUCK_S,
)
from gslts.ros.frame_memory import FrameMemory
from gslts.types import Floats

if TYPE_CHECKING:
    from gslts.ros.goals import Goals  # Needs ROS.

POLL_S = 0.05
"""Time between two tests if the robot has arrived, s."""
TILT_S = 0.5
"""Time for the camera to tilt once the robot stands, s."""


class RosRobot:
    """A `Robot` in the coordinates of the map.

    Args:
        memory: Frames that were placed in the map.
        believed_pose: Returns the newest [4,4] pose of the odometry; raises ValueError without one.
        base_from_camera: Returns the [4,4] pose of the camera on the robot, m; None if unknown:
            then goals of the robot are those of the camera.
        map_from_odometry: Returns the [4,4] correction of the odometry.
        newest_s: Returns the stamp of the newest image, s.
        positions: Returns [P,2] free positions of the map; None without a map.
        goals: Drives the robot; None if it is only watched, and has no reachable positions.
        stop: Set if waiting should end.
    """

    def __init__(
        self,
        memory: FrameMemory,
        believed_pose: Callable[[], Floats],
        base_from_camera: Callable[[], Floats | None],
        map_from_odometry: Callable[[], Floats],
        newest_s: Callable[[], float],
        positions: Callable[[], Floats] | None,
        goals: Goals | None,
        stop: threading.Event,
    ) -> None:
        self._memory, self._believed_pose = memory, believed_pose
        self._base_from_camera = base_from_camera
        self._map_from_odometry, self._newest_s = map_from_odometry, newest_s
        self._positions, self._goals, self._stop = positions, goals, stop
        self._foreign_until_s = 0.0
        self._preempted = threading.Event()

    def leave_alone(self) -> None:
        """Give no goals for some time, as somebody else gave the robot a goal."""
        self._foreign_until_s = time.monotonic() + FOREIGN_GOAL_S
        self._preempted.set()

    @property
    def is_left_alone(self) -> bool:
        """True if the robot follows the goal of somebody else."""
        is_busy = self._goals is not None and self._goals.is_busy
        return is_busy or time.monotonic() < self._foreign_until_s

    def observe(self) -> RgbdFrame:
        """Wait for a frame that is taken from now on.

        Raises:
            RobotLostError: None comes.
        """
        frame = self._memory.wait_after(self._newest_s, OBSERVE_TIMEOUT_S)
        if frame is None:
            raise RobotLostError(f"no frame came within {OBSERVE_TIMEOUT_S:g} s")
        return frame

    def pose(self) -> Floats:
        """Return [4,4] world_from_camera in the map, m.

        Raises:
            RobotLostError: There is no pose.
        """
        return rigid(self._map_from_odometry() @ self._odometry())

    def reachable_positions(self) -> Floats:
        """Return [P,2] free positions of the map, x and y, m; none if the robot is only watched."""
        if self._positions is None or self._goals is None or self.is_left_alone:
            return np.zeros((0, 2))
        return self._positions()

    def move_towards(
        self, position: Floats, yaw_rad: float, pitch_rad: float | None = None
    ) -> bool:
        """Give the robot a goal, and wait until it stands there; see `Robot.move_towards`.

        Args:
            position: (2,) x and y in the map, m.
            yaw_rad: Final direction of the camera in the map, rad.
            pitch_rad: Final angle below the horizon, rad; None keeps the present one.

        Returns:
            False if the robot stops elsewhere, or somebody else gives it a goal.

        Raises:
            RobotLostError: The robot has no pose.
        """
        if self._goals is None or self.is_left_alone:
            return False
        self._preempted.clear()
        if pitch_rad is not None:
            self._goals.tilt_to(pitch_rad)
        # The correction of the odometry also tilts a little, which far from its origin is metres:
        # the goal is given relative to the present pose.
        here, believed = self.pose(), self._odometry()
        turn_rad = yaw_of(believed) - yaw_of(here)
        goal = believed[:2, 3] + _turn(turn_rad) @ (position - here[:2, 3])
        self._goals.drive_to(*self._goal_of_base(goal, yaw_rad + turn_rad))
        arrived = False
        try:
            arrived = self._wait_until_at(goal, yaw_rad + turn_rad)
        finally:
            if not arrived and not self._preempted.is_set():
                self._goals.cancel()
        return arrived

    def _odometry(self) -> Floats:
        """Return the newest [4,4] pose of the camera by the odometry, m."""
        try:
            return self._believed_pose()
        except ValueError as error:
            raise RobotLostError(str(error)) from None

    def _goal_of_base(self, position: Floats, yaw_rad: float) -> tuple[Floats, float]:
        """Return position (2,), m, and direction, rad, of the base for those of the camera."""
        mount = self._base_from_camera()
        if mount is None:
            return position, yaw_rad
        yaw_of_base_rad = yaw_rad - yaw_of(mount)
        return position - _turn(yaw_of_base_rad) @ mount[:2, 3], yaw_of_base_rad

    def _wait_until_at(self, goal: Floats, yaw_rad: float) -> bool:
        """Return whether the robot comes to rest at a goal, in the frame of its odometry."""
        assert self._goals is not None
        start_s = moved_s = time.monotonic()
        last = self._odometry()
        while (now_s := time.monotonic()) - start_s < GOAL_TIMEOUT_S:
            if self._stop.wait(POLL_S) or self._preempted.is_set():
                return False
            pose = self._odometry()
            moved_m, turned_rad = pose_distance(last, pose)
            if moved_m > STILL_M or turned_rad > STILL_RAD:
                last, moved_s = pose, now_s
            off_rad = (yaw_of(pose) - yaw_rad + np.pi) % (2 * np.pi) - np.pi
            is_there = np.linalg.norm(pose[:2, 3] - goal) < ARRIVED_M and abs(off_rad) < ARRIVED_RAD
            rests = is_there or self._goals.has_ended
            if now_s - moved_s > (TILT_S if rests else STUCK_S):
                return bool(is_there)
        return False


def yaw_pose(position: Floats, yaw_rad: float) -> Floats:
    """Return the pose of a base on the floor.

    Args:
        position: (2,) x and y, m.
        yaw_rad: About z, rad.

    Returns:
        [4,4] rigid, at height 0, m.
    """
    pose = np.eye(4)
    pose[:2, :2] = _turn(yaw_rad)
    pose[:2, 3] = position
    return pose


def _turn(yaw_rad: float) -> Floats:
    """Return the [2,2] rotation by an angle."""
    cosine, sine = np.cos(yaw_rad), np.sin(yaw_rad)
    return np.array([[cosine, -sine], [sine, cosine]])


def yaw_of(pose: Floats) -> float:
    """Return the direction of a camera about z, from x to y, rad.

    Args:
        pose: [4,4] world_from_camera, m.
    """
    return float(np.arctan2(pose[1, 2], pose[0, 2]))
