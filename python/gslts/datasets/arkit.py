"""Axes of ARKit, in which Polycam and Record3D store poses.

The camera has the axes of OpenGL (x right, y up, z backward), and the world has y up:
https://developer.apple.com/documentation/arkit/arconfiguration/worldalignment/gravity.
"""

from __future__ import annotations

import numpy as np

from gslts.datasets.dataset import rigid
from gslts.datasets.poses import OPENGL_FROM_OPENCV
from gslts.types import Floats

WORLD_FROM_ARKIT = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]])
"""[4,4] from a world with y up to one with z up."""


def pose_from_arkit(arkit_from_camera: Floats) -> Floats:
    """Return the pose of a camera in the axes of this project.

    Args:
        arkit_from_camera: [4,4] pose in ARKit's axes, m.

    Returns:
        [4,4] world_from_camera, m.

    Raises:
        ValueError: The pose is not rigid.
    """
    return rigid(WORLD_FROM_ARKIT @ arkit_from_camera @ OPENGL_FROM_OPENCV)
