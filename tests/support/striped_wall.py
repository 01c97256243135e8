"""A striped wall, seen by one camera, and a grey map of it."""

import numpy as np

import gslts
from gslts.core.frame import RgbdFrame
from gslts.mapping.observation import Observation
from gslts.mapping.seeding.depth_seeds import flat_gaussians

CAMERA = gslts.Camera(fx=60, fy=60, cx=40, cy=30, width=80, height=60, world_from_camera=np.eye(4))
WALL_M = 2.0


def half_striped() -> Observation:
    """A wall in front of the camera: plain on the left, stripes of 3 px on the right."""
    rgb = np.full((60, 80, 3), 128, np.uint8)
    rgb[:, 40:] = np.where(np.arange(40) // 3 % 2, 50, 200)[None, :, None]
    return Observation.of(RgbdFrame(rgb, np.full((60, 80), WALL_M, np.float32), CAMERA))


def grey_wall() -> gslts.GaussianMap:
    grid = np.stack(np.meshgrid(np.arange(-1.35, 1.4, 0.1), np.arange(-1.05, 1.1, 0.1)), axis=-1)
    points = np.concatenate([grid.reshape(-1, 2), np.full((grid.size // 2, 1), WALL_M)], axis=1)
    normals, colors = np.tile([0.0, 0, -1], (len(points), 1)), np.full(points.shape, 0.5)
    return flat_gaussians(points, normals, colors, np.full(len(points), 0.1), 0.8, 0)
