"""A robot inside a map: it observes renderings and moves through free space of the map."""

from __future__ import annotations

import numpy as np

from gslts.core.camera import Camera, at_pose, look_at
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.core.robot_body import RobotBody
from gslts.navigation.planner import free_cells
from gslts.navigation.semantic_map import SemanticMap
from gslts.rendering.rendered_frame import render_frame
from gslts.types import Floats

MAX_PITCH_RAD = 1.2
"""Maximum angle of the camera below or above the horizon; at pi/2 its yaw would be undefined."""


class MapRobot:
    """A `Robot` that observes a map and moves in its free space, to try a path without a robot.

    Args:
        gaussian_map: float32.
        semantic_map: Semantic map of `gaussian_map`, with its free space.
        body: Size of the robot.
        camera: Intrinsics and start pose; its height stays. From where the body does not fit, the
            robot is put down at the nearest position where it does.
        threads: Number of threads; 0 means one per hardware thread.
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
        room = free_cells(
            semantic_map.explored, semantic_map.obstacles, body.radius_m / grid.cell_m
        )
        self._positions = grid.centers(np.argwhere(room))
        self._map, self._camera, self._threads = gaussian_map, camera, threads
        pose = camera.world_from_camera
        offsets_m = np.linalg.norm(self._positions - pose[:2, 3], axis=1)
        if offsets_m.min(initial=np.inf) > grid.cell_m:
            self.move_towards(pose[:2, 3], float(np.arctan2(pose[1, 2], pose[0, 2])))

    def observe(self) -> RgbdFrame:
        """Render the map from the camera of the robot."""
        return render_frame(self._map, self._camera, self._threads)

    def pose(self) -> Floats:
        """Return [4,4] world_from_camera, m."""
        return self._camera.world_from_camera

    def reachable_positions(self) -> Floats:
        """Return [P,2] centres of the cells where the body fits, x and y in the world, m."""
        return self._positions

    def move_towards(
        self, position: Floats, yaw_rad: float, pitch_rad: float | None = None
    ) -> bool:
        """Move to the free cell nearest to `position`; see `Robot.move_towards`.

        Args:
            position: (2,) x and y in the world, m.
            yaw_rad: Final direction, rad.
            pitch_rad: Final angle below the horizon, rad; None keeps the current one.

        Returns:
            False only if the body fits nowhere.
        """
        if len(self._positions) == 0:
            return False
        pose = self._camera.world_from_camera
        if pitch_rad is None:
            pitch_rad = float(np.arcsin(np.clip(-pose[2, 2], -1, 1)))
        pitch_rad = float(np.clip(pitch_rad, -MAX_PITCH_RAD, MAX_PITCH_RAD))
        nearest = self._positions[np.argmin(np.linalg.norm(self._positions - position, axis=1))]
        eye = np.array([*nearest, pose[2, 3]])
        level = np.cos(pitch_rad)
        ahead = np.array([level * np.cos(yaw_rad), level * np.sin(yaw_rad), -np.sin(pitch_rad)])
        self._camera = at_pose(self._camera, look_at(eye, eye + ahead))
        return True
