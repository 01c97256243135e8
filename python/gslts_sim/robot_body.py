"""The simulated robot's body: its size, where it can be, and where its camera is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gslts.core.camera import Camera, camera_from_fov, look_at
from gslts.types import Floats
from gslts_sim.home import Home
from gslts_sim.walkable import WalkableFloor, walkable_floor

HORIZON_DEG = (-30.0, 60.0)
"""Least and greatest angle of the camera below the horizon."""
BODY_RADIUS_M = 0.2
BODY_HEIGHT_M = 1.2
CAMERA_HEIGHT_M = 1.5
FOV_RAD = np.pi / 2
"""Horizontal field of view."""


@dataclass(frozen=True, eq=False)
class Look:
    """Where the robot stands and looks.

    Args:
        place: (2,) x and y, m.
        yaw_deg: About z, from x to y, degrees.
        horizon_deg: Of the camera below the horizon, degrees.
    """

    place: Floats
    yaw_deg: float
    horizon_deg: float


def robot_camera(
    home: Home,
    look: Look,
    size: tuple[int, int],
    fov_rad: float = FOV_RAD,
) -> Camera:
    """The robot's camera.

    Args:
        home: Whose floor the robot stands on.
        look: Where it stands and looks.
        size: Width and height, px.
        fov_rad: Horizontal field of view, rad.
    """
    yaw, down = np.deg2rad(look.yaw_deg), np.deg2rad(look.horizon_deg)
    eye = np.array([*look.place, home.space.box[0, 2] + CAMERA_HEIGHT_M])
    ahead = (np.cos(yaw) * np.cos(down), np.sin(yaw) * np.cos(down), -np.sin(down))
    return camera_from_fov(*size, fov_rad, look_at(eye, eye + ahead))


def floor_of(home: Home) -> WalkableFloor:
    """Where the robot can be in a home."""
    return walkable_floor(home, home.space, BODY_RADIUS_M, BODY_HEIGHT_M)
