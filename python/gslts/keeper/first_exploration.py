"""First visit of a home: a robot without a map explores it, and takes the frames of a map."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from gslts.core.frame import RgbdFrame
from gslts.core.robot import Robot
from gslts.keeper.exploration import RINGS
from gslts.navigation.frontiers import FrontierExplorer

Ring = tuple[int, float]
"""Number of directions all around, and the angle of the camera below the horizon, rad."""


def explore_home(
    robot: Robot, explorer: FrontierExplorer, rings: Sequence[Ring] = RINGS
) -> Iterator[RgbdFrame]:
    """Move a robot through a home that it does not know, and yield the frames that it takes.

    Args:
        robot: In the home. Goals that it does not reach are blocked.
        explorer: Chooses the goals; its floor is filled with the frames.
        rings: Views at each goal.

    Raises:
        ValueError: No floor is seen at the start.
    """
    position = robot.pose()[:2, 3]
    while True:
        for count, pitch_rad in rings:
            for number in range(count):
                if robot.move_towards(position, 2 * np.pi * number / count, pitch_rad):
                    frame = robot.observe()
                    explorer.floor.add(frame)
                    yield frame
        goal = explorer.next_goal(robot.pose()[:2, 3])
        if goal is None:
            return
        position = goal.position
        if not robot.move_towards(position, goal.yaw_rad):
            explorer.block(position)
