"""Exploration of a home without a map: the robot drives to frontiers, and turns around there."""

from __future__ import annotations

import threading
from collections.abc import Callable

import numpy as np

from gslts.core.robot_body import RobotBody
from gslts.navigation.frontiers import FrontierExplorer
from gslts.navigation.observed_floor import ObservedFloor
from gslts.ros.frame_memory import FrameMemory
from gslts.ros.robot import RosRobot

FLOOR_M = 0.0
"""Height of the floor in the frame of the poses, m: that of the base at the start."""
PITCH_RAD = float(np.deg2rad(20))
"""Angle of the camera below the horizon, rad: floor from 1.3 m on, and furniture; see
`gslts.keeper.exploration.RINGS`."""
QUARTERS = 4
"""Goals of a turn around: frames are remembered on the way from each to the next."""


def explore(
    robot: RosRobot,
    memory: FrameMemory,
    body: RobotBody,
    stop: threading.Event,
    log: Callable[[str], None],
) -> None:
    """Explore until no frontier is left that the robot can reach, or a stop is requested.

    Args:
        robot: In the coordinates of its odometry.
        memory: Gets the frames on the way.
        body: Size of the robot.
        stop: Set if the node should end.
        log: Called with one line for each position.

    Raises:
        RobotLostError: The robot has no pose, or no frame comes.
    """
    added_s = robot.observe().time_s
    floor = ObservedFloor(robot.pose()[:2, 3], FLOOR_M, body)
    explorer = FrontierExplorer(floor, body)
    count = 0
    while not stop.is_set():
        _turn_around(robot, stop)
        for frame in memory.since(added_s):
            floor.add(frame)
            added_s = max(added_s, frame.time_s + 1e-6)
        goal = explorer.next_goal(robot.pose()[:2, 3])
        if goal is None:
            return
        count += 1
        x, y = goal.position.tolist()
        log(f"exploring: position {count} at ({x:.2f}, {y:.2f}) m")
        if not robot.move_towards(goal.position, goal.yaw_rad, PITCH_RAD):
            explorer.block(goal.position)


def _turn_around(robot: RosRobot, stop: threading.Event) -> None:
    pose = robot.pose()
    start_rad = float(np.arctan2(pose[1, 2], pose[0, 2]))
    for quarter in range(1, QUARTERS + 1):
        if stop.is_set():
            return
        yaw_rad = start_rad + 2 * np.pi * quarter / QUARTERS
        robot.move_towards(robot.pose()[:2, 3], yaw_rad, PITCH_RAD)
        robot.observe()
