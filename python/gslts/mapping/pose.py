"""Small changes of a camera's pose."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gslts.camera import Camera, at_pose, rotation, rotation_vector

Floats = NDArray[np.float64]


def moved(camera: Camera, twist: Floats) -> Camera:
    """The camera at world_from_camera @ exp(xi), with exp to first order in the translation."""
    step = np.eye(4)
    step[:3, :3], step[:3, 3] = rotation(twist[3:]), twist[:3]
    return at_pose(camera, camera.world_from_camera @ step)


def twist_of(motion: Floats) -> Floats:
    """(6,) the twist whose `moved` is a rigid motion [4,4], for turns well below pi."""
    return np.concatenate([motion[:3, 3], rotation_vector(motion[:3, :3])])
