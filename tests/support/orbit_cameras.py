"""Cameras around a map of random numbers, and their entries in files."""

from typing import Any

import numpy as np
import scenes
from scipy.spatial.transform import Rotation

import gslts

SIZE = {"width": 64, "height": 48}


def around(count: int, *, roll_rad: float = 0.0) -> dict[str, gslts.Camera]:
    """Cameras on a circle, each with a name, and with a camera that looks away beside it."""
    cameras = {}
    for k in range(count):
        camera = scenes.orbit_camera(**SIZE, angle_rad=0.2 + 2 * np.pi * k / count)
        turn = np.eye(4)
        turn[:3, :3] = Rotation.from_rotvec([0, np.pi, 0]).as_matrix()
        away = camera.world_from_camera @ turn
        turn[:3, :3] = Rotation.from_rotvec([0, 0, roll_rad]).as_matrix()
        pose = camera.world_from_camera @ turn
        cameras[f"away {k}"] = gslts.camera_from_fov(*SIZE.values(), 0.9, away)
        cameras[f"in {k}"] = gslts.camera_from_fov(*SIZE.values(), 0.9, pose)
    return cameras


def entry(camera: gslts.Camera, *, lens: bool = True) -> dict[str, Any]:
    """Return a camera as it stands in a JSON file."""
    names = ("fx", "fy", "cx", "cy", "width", "height") if lens else ()
    values = {name: getattr(camera, name) for name in names}
    return {**values, "world_from_camera": camera.world_from_camera.tolist()}
