"""Exploration of a home without a map: the robot drives to frontiers, and turns around there."""

from __future__ import annotations

import threading
from collections.abc import Callable

import numpy as np

from gslts.core.robot_body import RobotBody
from gslts.navigation.frontiers import FrontierExplorer
from gslts.navigation.observed_floor import ObservedFloor
from gslts.ros.frame_memory import FrameMemory
from gslts.ros.robot import RosRobot, yaw_of
from gslts.types import Floats

FLOOR_M = 0.0
"""Height of the floor in the frame of the poses, m: that of the base at the start."""
DOWN_RAD, UP_RAD = np.deg2rad(20.0), np.deg2rad(-10.0)
"""Angles of the camera below the horizon in a turn around, rad: the first shows floor and
furniture, the second the walls above, as `gslts.keeper.exploration.RINGS`. With the first alone,
upper walls are blurred in the map, and changes are reported there."""
UP_APART_M = 2.0
"""Distance between positions of the second turn, m: the walls above are seen from afar."""
THIRDS = 3
"""Goals of a turn around: frames are remembered on the way from each to the next, and the shorter
way to it is less than half a turn."""


def explore(
    robot: RosRobot,
    memory: FrameMemory,
    body: RobotBody,
    can_tilt: bool,
    stop: threading.Event,
    log: Callable[[str], None],
) -> None:
    """Explore until no frontier is left that the robot can reach, or a stop is requested.

    Args:
        robot: In the coordinates of its odometry.
        memory: Gets the frames on the way.
        body: Size of the robot.
        can_tilt: The camera can be tilted.
        stop: Set if the node should end.
        log: Called with one line for each position.

    Raises:
        RobotLostError: The robot has no pose, or no frame comes.
        ValueError: No floor is seen near the robot.
    """
    added_s = robot.observe().time_s
    floor = ObservedFloor(robot.pose()[:2, 3], FLOOR_M, body)
    explorer = FrontierExplorer(floor, body)
    looked_up: list[Floats] = []
    count = 0
    while not stop.is_set():
        here = robot.pose()[:2, 3]
        _turn_around(robot, DOWN_RAD, stop)
        if can_tilt and all(np.linalg.norm(here - there) > UP_APART_M for there in looked_up):
            _turn_around(robot, UP_RAD, stop)
            looked_up.append(here)
        for frame in memory.since(added_s):
            floor.add(frame)
            added_s = max(added_s, frame.time_s + 1e-6)
        goal = explorer.next_goal(robot.pose()[:2, 3])
        if goal is None:
            return
        count += 1
        x, y = goal.position.tolist()
        log(f"exploring: position {count} at ({x:.2f}, {y:.2f}) m")
        if not robot.move_towards(goal.position, goal.yaw_rad, DOWN_RAD):
            explorer.block(goal.position)


def _turn_around(robot: RosRobot, pitch_rad: float, stop: threading.Event) -> None:
    start_rad = yaw_of(robot.pose())
    for third in range(1, THIRDS + 1):
        if stop.is_set():
            return
        yaw_rad = start_rad + 2 * np.pi * third / THIRDS
        robot.move_towards(robot.pose()[:2, 3], yaw_rad, pitch_rad)
