"""A point cloud of the surfaces of a map, with which the depth of a frame is registered (GICP)."""

from __future__ import annotations

import numpy as np

from gslts._core import reloc as _core
from gslts.core.camera import at_pose, unproject
from gslts.core.gaussian_map import GaussianMap
from gslts.core.se3 import transform
from gslts.localization.constants import CLOUD_LEVEL, CLOUD_MARGIN_M, SOLID_OPACITY
from gslts.localization.image_pyramid import ImagePyramid
from gslts.types import Floats, Floats32


class SurfaceCloud:
    """Registers depth images with the centres of the solid Gaussians of a map.

    Args:
        gaussian_map: float32.
    """

    def __init__(self, gaussian_map: GaussianMap) -> None:
        self._map = gaussian_map

    def register(self, pyramid: ImagePyramid, world_from_camera: Floats) -> Floats:
        """Move a pose so that the depth of a frame lies on the surfaces of the map.

        Args:
            pyramid: Images of the frame.
            world_from_camera: [4,4] initial pose, m, some 10 cm off at most.

        Returns:
            [4,4] world_from_camera, m; the initial pose if too few points overlap.
        """
        in_camera = depth_points(pyramid)
        guess = world_from_camera.copy()
        guess[:3, 3] -= self._map.origin
        in_map = transform(guess, in_camera)
        if len(in_map) == 0:
            return world_from_camera
        low, high = in_map.min(axis=0) - CLOUD_MARGIN_M, in_map.max(axis=0) + CLOUD_MARGIN_M
        found = _core.register_clouds(
            in_camera.astype(np.float32),
            self._points(low, high),
            guess,
            rule=_core.CloudRule(),
        )
        pose = np.array(found.target_from_source)
        pose[:3, 3] += self._map.origin
        return pose

    def _points(self, low: Floats, high: Floats) -> Floats32:
        """Return the centres [P,3] of solid Gaussians between two corners (3,) in the map, m."""
        rows = self._map.rows_in_box(low + self._map.origin, high + self._map.origin)
        near_map = self._map.select(rows)
        points = near_map.means
        solid = near_map.logit_opacities > np.log(SOLID_OPACITY / (1 - SOLID_OPACITY))
        near: Floats32 = points[solid & ((points > low) & (points < high)).all(axis=1)]
        return near


def depth_points(pyramid: ImagePyramid, level: int = CLOUD_LEVEL) -> Floats:
    """Return the measured points [P,3] of a frame in its camera frame, m.

    Args:
        pyramid: Images of the frame.
        level: Level of the pyramid, or the coarsest if it has fewer.
    """
    level = min(level, len(pyramid.frames) - 1)
    depth, camera = pyramid.depths[level], at_pose(pyramid.frames[level].camera, np.eye(4))
    rows, columns = np.nonzero(depth)
    pixels = np.column_stack([columns, rows]).astype(np.float64) + 0.5
    return unproject(camera, pixels, depth[rows, columns].astype(np.float64))
