"""The surfaces of a map as a cloud, with which the depth of a frame is registered."""

from __future__ import annotations

import numpy as np

from gslts._core import reloc as _core
from gslts.core.camera import unproject
from gslts.core.gaussian_map import GaussianMap
from gslts.core.se3 import inverse_transform, transform
from gslts.localization.image_pyramid import Pictures
from gslts.types import Floats

LEAST_OPACITY = 0.5
"""Of a Gaussian that is part of a surface."""
LEVEL = 2
"""Halvings of the depth image, if it is so large: thousands of points do, and means err less."""
MARGIN_M = 0.5
"""Around the frame's points, where the map's count."""


class SurfaceCloud:
    """Centres of a map's Gaussians that are solid.

    Args:
        gaussian_map: float32.
    """

    def __init__(self, gaussian_map: GaussianMap) -> None:
        solid = gaussian_map.logit_opacities > np.log(LEAST_OPACITY / (1 - LEAST_OPACITY))
        self._origin = gaussian_map.origin
        self._points = np.ascontiguousarray(gaussian_map.means[solid])

    def registered(self, pictures: Pictures, world_from_camera: Floats) -> Floats:
        """[4,4] the pose nearby at which the depth of a frame lies on the map's surfaces.

        Args:
            pictures: Of the frame.
            world_from_camera: [4,4] some 10 cm off at most; comes back if there is too little.
        """
        level = min(LEVEL, len(pictures.frames) - 1)
        depth, camera = pictures.depths[level], pictures.frames[level].camera
        rows, columns = np.nonzero(depth)
        places = np.column_stack([columns, rows]).astype(np.float64) + 0.5
        in_world = unproject(camera, places, depth[rows, columns].astype(np.float64))
        in_camera = inverse_transform(camera.world_from_camera, in_world)
        guess = world_from_camera.copy()
        guess[:3, 3] -= self._origin
        around = transform(guess, in_camera)
        if len(around) == 0:
            return world_from_camera
        low, high = around.min(axis=0) - MARGIN_M, around.max(axis=0) + MARGIN_M
        near = ((self._points > low) & (self._points < high)).all(axis=1)
        found = _core.register_clouds(
            in_camera.astype(np.float32),
            np.ascontiguousarray(self._points[near]),
            guess,
            rule=_core.CloudRule(),
        )
        pose = np.array(found.target_from_source)
        pose[:3, 3] += self._origin
        return pose
