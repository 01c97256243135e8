"""Visibility of an object from the viewpoints of the robot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gslts.types import Floats
from gslts_sim.home import Home, HomeObject
from gslts_sim.ray_scene import RayScene
from gslts_sim.robot_body import CAMERA_HEIGHT_M, HORIZON_DEG, Viewpoint, robot_camera

SAMPLES = 24
"""Number of points on an object's surface whose visibility is tested."""
SIZE_PX = (160, 120)
"""Width and height of the images in which an object's pixels are counted."""
GRID_DEG = 5.0
"""Viewpoints towards an object have angles on this grid, degrees, so that scripts stay short."""


@dataclass(frozen=True, eq=False)
class ObjectVisibility:
    """Tests from where an object is visible, in one state of a home.

    Args:
        home: With the object.
        scene: Ray caster of that home.
        object_id: Of the object.
    """

    home: Home
    scene: RayScene
    object_id: str

    @property
    def obj(self) -> HomeObject:
        """The object."""
        return self.home[self.object_id]

    @property
    def center(self) -> Floats:
        """(3,) centre of the box around the object, m."""
        center: Floats = self.obj.box_in_world.mean(axis=0)
        return center

    def visible_fraction(self, positions: Floats) -> Floats:
        """Compute the fraction of the object's sample points that are visible.

        Args:
            positions: [P,2] of the robot, x and y, m.

        Returns:
            [P] from 0 to 1.
        """
        eyes = camera_positions(self.home, positions)
        points = _points_on(self.obj)
        origins = np.repeat(eyes[:, None], len(points), axis=1)
        rays = np.concatenate([origins, points[None] - origins], axis=-1)
        hits = self.scene.cast(rays.astype(np.float32))
        rows = self.scene.owners[np.where(np.isfinite(hits.distances), hits.triangles, 0)]
        fraction: Floats = (rows == self._row).mean(axis=1)
        return fraction

    def visible_px(self, viewpoint: Viewpoint, size: tuple[int, int] = SIZE_PX) -> int:
        """Count the pixels of the object in a view.

        Args:
            viewpoint: Of the robot.
            size: Width and height of the image, px.
        """
        camera = robot_camera(self.home, viewpoint, size)
        instances, _ = self.scene.instances(camera)
        return int((instances == self._row).sum())

    @property
    def _row(self) -> int:
        return [obj.id for obj in self.home.objects].index(self.object_id)


def camera_positions(home: Home, positions: Floats) -> Floats:
    """Return the positions of the robot's camera.

    Args:
        home: Defines the height of the floor.
        positions: [P,2] of the robot, x and y, m.

    Returns:
        [P,3] in the world, m.
    """
    height = home.space.box[0, 2] + CAMERA_HEIGHT_M
    return np.column_stack([positions, np.full(len(positions), height)])


def viewpoint_towards(
    home: Home, position: Floats, target: Floats, jitter_deg: Floats
) -> Viewpoint:
    """Return the viewpoint from a position towards a point.

    Args:
        home: Defines the height of the floor.
        position: (2,) of the robot, x and y, m.
        target: (3,) in the world, m.
        jitter_deg: (2,) added to yaw and horizon, degrees.
    """
    ray = target - camera_positions(home, position[None])[0]
    yaw_deg = np.rad2deg(np.arctan2(ray[1], ray[0]))
    horizon_deg = np.rad2deg(np.arctan2(-ray[2], np.hypot(ray[0], ray[1])))
    yaw_deg, horizon_deg = (
        GRID_DEG * np.round((angle + turn) / GRID_DEG)
        for angle, turn in zip((yaw_deg, horizon_deg), jitter_deg, strict=True)
    )
    return Viewpoint.at(position, float(yaw_deg % 360), float(np.clip(horizon_deg, *HORIZON_DEG)))


def _points_on(obj: HomeObject) -> Floats:
    """Return [SAMPLES,3] points spread over the surface of an object, in the world, m."""
    corners = np.concatenate([surface.vertices[surface.faces] for surface in obj.surfaces])
    corners = corners @ obj.world_from_object[:3, :3].T + obj.world_from_object[:3, 3]
    areas = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    ends = np.cumsum(areas)
    picked = np.searchsorted(ends, (np.arange(SAMPLES) + 0.5) / SAMPLES * ends[-1])
    points: Floats = corners[np.minimum(picked, len(corners) - 1)].mean(axis=1)
    return points
