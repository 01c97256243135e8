"""A robot that is in the map instead of in the home."""

from __future__ import annotations

import numpy as np

from gslts.core.camera import Camera, at_pose, look_at
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.navigation.planner import room_for
from gslts.navigation.robot_body import RobotBody
from gslts.navigation.semantic_map import SemanticMap
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.types import Floats

LEAST_ALPHA = 0.5
"""Where the map is less opaque, it shows no surface."""
MOST_PITCH_RAD = 1.2


class MapRobot:
    """A `Robot` that sees what a map shows, and goes where the map has room: it tries ways out.

    Args:
        gaussian_map: float32.
        semantic_map: Of it.
        body: Of the robot.
        camera: Its lens, its height, and where it starts and looks.
        threads: 0 means one a hardware thread.
    """

    def __init__(
        self,
        gaussian_map: GaussianMap,
        semantic_map: SemanticMap,
        body: RobotBody,
        camera: Camera,
        threads: int = 0,
    ) -> None:
        grid = semantic_map.grid
        room = room_for(semantic_map.explored, semantic_map.obstacles, body.radius_m / grid.cell_m)
        self._places = grid.middles(np.argwhere(room))
        self._map, self._camera = gaussian_map, camera
        self._rasterizer, self._options = Rasterizer(np.float32), RenderOptions(threads=threads)

    def observe(self) -> RgbdFrame:
        """What the map shows from where the robot is."""
        images = self._rasterizer.forward(self._map, self._camera, self._options)
        rgb = np.rint(255 * images.rgb.clip(0, 1)).astype(np.uint8)
        depth = np.where(images.alpha >= LEAST_ALPHA, images.depth, 0).astype(np.float32)
        return RgbdFrame(rgb, depth, self._camera)

    def reachable_positions(self) -> Floats:
        """[P,2] middles of the cells with room for it, x and y in the world, m."""
        return self._places

    def move_towards(
        self, position: Floats, yaw_rad: float, pitch_rad: float | None = None
    ) -> bool:
        """As `Robot.move_towards`; it always arrives, if there is any room."""
        if len(self._places) == 0:
            return False
        pose = self._camera.world_from_camera
        if pitch_rad is None:
            pitch_rad = float(np.arcsin(np.clip(-pose[2, 2], -1, 1)))
        pitch_rad = float(np.clip(pitch_rad, -MOST_PITCH_RAD, MOST_PITCH_RAD))
        place = self._places[np.argmin(np.linalg.norm(self._places - position, axis=1))]
        eye = np.array([*place, pose[2, 3]])
        level = np.cos(pitch_rad)
        ahead = np.array([level * np.cos(yaw_rad), level * np.sin(yaw_rad), -np.sin(pitch_rad)])
        self._camera = at_pose(self._camera, look_at(eye, eye + ahead))
        return True
