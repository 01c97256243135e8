"""A robot with drifting odometry, and its localizer in the map of `change_room`."""

import json
import shutil
from functools import cache
from pathlib import Path

import change_room
import numpy as np
from landmark_room import folder_with, found

from gslts.core.frame import RgbdFrame
from gslts.core.robot import Robot
from gslts.core.se3 import rotation
from gslts.localization.config import RelocalizationConfig
from gslts.localization.localizer import Localizer, in_world
from gslts.localization.relocalizer import Relocalizer

TURN_RAD = float(np.deg2rad(10))
ODOMETRY_FROM_WORLD = np.eye(4)
"""Drift of the odometry: 30 cm and 10 degrees."""
ODOMETRY_FROM_WORLD[:3, :3] = rotation(np.array([0, 0, TURN_RAD]))
ODOMETRY_FROM_WORLD[:3, 3] = (0.24, -0.18, 0.0)
CONFIG = RelocalizationConfig(halvings=0, threads=1)
"""Full resolution, as the images are small already."""


class Adrift:
    """A robot in the world of its odometry, whose origin may be far away."""

    def __init__(self, robot: Robot, far: tuple[float, float, float] = (0, 0, 0)) -> None:
        self.robot = robot
        self.odometry_from_world = ODOMETRY_FROM_WORLD.copy()
        self.odometry_from_world[:3, 3] += far

    def observe(self) -> RgbdFrame:
        return in_world(self.robot.observe(), self.odometry_from_world)

    def pose(self) -> np.ndarray:
        return self.odometry_from_world @ self.robot.pose()

    def reachable_positions(self) -> np.ndarray:
        places = self.robot.reachable_positions()
        return places @ self.odometry_from_world[:2, :2].T + self.odometry_from_world[:2, 3]

    def move_towards(
        self, position: np.ndarray, yaw_rad: float, pitch_rad: float | None = None
    ) -> bool:
        in_room = (position - self.odometry_from_world[:2, 3]) @ self.odometry_from_world[:2, :2]
        return self.robot.move_towards(in_room, yaw_rad - TURN_RAD, pitch_rad)


@cache
def relocalizer() -> Relocalizer:
    """Return the relocalizer of the mapped room."""
    return Relocalizer(change_room.mapped()[0], found(), CONFIG)


def localizer() -> Localizer:
    """Return a localizer without a localized frame."""
    return Localizer(relocalizer())


def write_room_map(folder: Path) -> Path:
    """Write the map of the room with landmarks."""
    return folder_with(found(), folder)


def set_adrift(visit: Path, to: Path) -> None:
    """Copy a recording with drifting odometry."""
    shutil.copytree(visit, to)
    path = to / "transforms.json"
    content = json.loads(path.read_text())
    for frame in content["frames"]:
        pose = ODOMETRY_FROM_WORLD @ np.array(frame["transform_matrix"])
        frame["transform_matrix"] = pose.tolist()
    path.write_text(json.dumps(content))
