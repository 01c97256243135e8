"""From where a robot on its rounds sees all of a map."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gslts.change.visibility import Visibility
from gslts.core.camera import Camera
from gslts.core.gaussian_map import GaussianMap
from gslts.core.robot import Robot

POINTS = 4000
"""Gaussians that stand for all."""
LEAST_OPACITY = 0.5
FARTHEST_M = 2.5
"""What is farther away is not looked at closely enough to see a cup."""
ENOUGH = 0.95
"""Share of what can be seen that a round must show."""
METRES_PER_RAD = 0.5
"""What a turn counts against a way, when the next stop is chosen."""


def stops_of(
    gaussian_map: GaussianMap, cameras: Mapping[str, Camera], most: int, threads: int = 0
) -> tuple[str, ...]:
    """Names of viewpoints that show the map, in the order of a short way.

    Args:
        gaussian_map: float32.
        cameras: Where it was made from, by name, at least one: there a robot can be.
        most: Stops, at most.
        threads: 0 means one a hardware thread.

    Raises:
        ValueError: There is no camera.

    Source: greedy maximum coverage, Nemhauser, Wolsey and Fisher 1978.
    """
    if not cameras:
        raise ValueError("stops_of: nothing is known of where the map was made from")
    names = list(cameras)
    solid = np.flatnonzero(gaussian_map.logit_opacities > _logit(LEAST_OPACITY))
    rows = solid[:: max(1, len(solid) // POINTS)]
    points = gaussian_map.means[rows] + gaussian_map.origin
    shown = Visibility(gaussian_map, cameras.values(), threads).visible(points, FARTHEST_M)
    left = shown.any(axis=0)
    enough = (1 - ENOUGH) * left.sum()
    chosen: list[int] = []
    while len(chosen) < most and left.sum() > enough:
        chosen.append(int(np.argmax((shown & left).sum(axis=1))))
        left &= ~shown[chosen[-1]]
    return _short_way([names[row] for row in chosen or [0]], cameras)


def go_to(robot: Robot, camera: Camera) -> bool:
    """Sends a robot to where a camera was; whether it arrived."""
    pose = camera.world_from_camera
    x, y, z = pose[:3, 2]
    return robot.move_towards(
        pose[:2, 3], float(np.arctan2(y, x)), float(np.arctan2(-z, np.hypot(x, y)))
    )


def _short_way(names: list[str], cameras: Mapping[str, Camera]) -> tuple[str, ...]:
    """From the first one always to the nearest that is left."""
    way, left = names[:1], names[1:]
    while left:
        here = cameras[way[-1]].world_from_camera
        poses = np.array([cameras[name].world_from_camera for name in left])
        metres = np.linalg.norm(poses[:, :3, 3] - here[:3, 3], axis=1)
        turns_rad = np.arccos(np.clip(poses[:, :3, 2] @ here[:3, 2], -1, 1))
        way.append(left.pop(int(np.argmin(metres + METRES_PER_RAD * turns_rad))))
    return tuple(way)


def _logit(share: float) -> float:
    return float(np.log(share / (1 - share)))
