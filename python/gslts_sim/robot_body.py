"""The simulated robot: its size, and the pose of its camera."""

from __future__ import annotations

import numpy as np
from pydantic import ConfigDict, FiniteFloat
from pydantic.dataclasses import dataclass

from gslts.core.camera import Camera, camera_from_fov, look_at
from gslts.core.robot_body import RobotBody
from gslts.types import Floats
from gslts_sim.home import Home, pose
from gslts_sim.oriented_boxes import OrientedBoxes

HORIZON_DEG = (-30.0, 60.0)
"""Range of the camera's angle below the horizon, degrees: AI2-THOR's limits."""
BODY = RobotBody(radius_m=0.2, height_m=1.2, step_m=0.02)
"""Size of the simulated robot, a typical service robot that drives over rugs."""
CAMERA_HEIGHT_M = 1.5
"""Height of the camera above the floor, m; the camera mast is thinner than the body."""
FOV_RAD = np.pi / 2
"""Default horizontal field of view of the camera, rad, as in AI2-THOR."""


@dataclass(frozen=True, config=ConfigDict(extra="forbid", strict=True))
class Viewpoint:
    """Pose of the robot on the floor, and the direction of its camera.

    Args:
        x: In the world, m.
        y: In the world, m.
        yaw_deg: About z, from x to y, degrees.
        horizon_deg: Angle of the camera below the horizon, degrees.
    """

    x: FiniteFloat
    y: FiniteFloat
    yaw_deg: FiniteFloat
    horizon_deg: FiniteFloat

    @classmethod
    def at(cls, position: Floats, yaw_deg: float, horizon_deg: float) -> Viewpoint:
        """Return the viewpoint at a position.

        Args:
            position: (2,) x and y in the world, m.
            yaw_deg: About z, from x to y, degrees.
            horizon_deg: Angle of the camera below the horizon, degrees.
        """
        x, y = position.tolist()
        return cls(x, y, yaw_deg, horizon_deg)

    @property
    def position(self) -> Floats:
        """(2,) x and y, m."""
        return np.array([self.x, self.y])


def body_boxes(home: Home, position: Floats) -> OrientedBoxes:
    """Return the box that the robot fills.

    Args:
        home: Defines the height of the floor.
        position: (2,) x and y of the robot, m.
    """
    low = float(home.space.box[0, 2]) + BODY.step_m
    radius = BODY.radius_m
    box = np.array([(-radius, -radius, 0.0), (radius, radius, BODY.height_m)])
    x, y = position.tolist()
    return OrientedBoxes.from_object(box[None], pose(x, y, low, 0.0))


def robot_camera(
    home: Home, viewpoint: Viewpoint, size: tuple[int, int], fov_rad: float = FOV_RAD
) -> Camera:
    """Return the robot's camera at a viewpoint.

    Args:
        home: Defines the height of the floor.
        viewpoint: Position of the robot and direction of its camera.
        size: Width and height of the image, px.
        fov_rad: Horizontal field of view, rad.
    """
    eye = np.array([viewpoint.x, viewpoint.y, home.space.box[0, 2] + CAMERA_HEIGHT_M])
    direction = camera_direction(np.deg2rad(viewpoint.yaw_deg), np.deg2rad(viewpoint.horizon_deg))
    return camera_from_fov(*size, fov_rad, look_at(eye, eye + direction))


def camera_direction(yaw_rad: float, down_rad: float) -> Floats:
    """Return the unit vector along a camera's optical axis.

    Args:
        yaw_rad: About z, from x to y, rad.
        down_rad: Angle below the horizon, rad.

    Returns:
        (3,) float64, in the world.
    """
    cosine = np.cos(down_rad)
    return np.array([np.cos(yaw_rad) * cosine, np.sin(yaw_rad) * cosine, -np.sin(down_rad)])
