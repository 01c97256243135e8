"""Driving of a robot to the poses of cameras, on a short path."""

from __future__ import annotations

import numpy as np

from gslts.core.camera import Camera
from gslts.core.robot import Robot
from gslts.types import Floats

METRES_PER_RAD = 0.5
"""Cost of a turn when the next pose is chosen, m/rad."""


def go_to(robot: Robot, camera: Camera) -> bool:
    """Move a robot to the pose of a camera.

    Args:
        robot: To move.
        camera: Its pose in the world frame.

    Returns:
        True if the robot arrived.
    """
    pose = camera.world_from_camera
    x, y, z = pose[:3, 2]
    return robot.move_towards(
        pose[:2, 3], float(np.arctan2(y, x)), float(np.arctan2(-z, np.hypot(x, y)))
    )


def short_path(poses: Floats, start: Floats) -> list[int]:
    """Return poses in the order of the nearest neighbour of the last one.

    Args:
        poses: [P,4,4] world_from_camera, m.
        start: [4,4] pose before the first one, m.

    Returns:
        Their P rows.
    """
    left, path, here = list(range(len(poses))), [], start
    while left:
        metres = np.linalg.norm(poses[left, :3, 3] - here[:3, 3], axis=1)
        turns_rad = np.arccos(np.clip(poses[left, :3, 2] @ here[:3, 2], -1, 1))
        path.append(left.pop(int(np.argmin(metres + METRES_PER_RAD * turns_rad))))
        here = poses[path[-1]]
    return path
