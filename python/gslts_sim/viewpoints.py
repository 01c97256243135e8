"""From where a robot in a home sees an object."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gslts.types import Floats
from gslts_sim.home import Home, HomeObject
from gslts_sim.ray_scene import RayScene
from gslts_sim.robot_body import CAMERA_HEIGHT_M, HORIZON_DEG, Viewpoint, robot_camera

SAMPLES = 24
"""Points of an object whose visibility stands for its own."""
SIZE_PX = (160, 120)
"""Of the images in which the pixels of objects are counted."""


@dataclass(frozen=True, eq=False)
class ObjectVisibility:
    """An object in one state of a home, for questions of who sees it.

    Args:
        home: With the object.
        scene: The rays of that home.
        object_id: Of the object.
    """

    home: Home
    scene: RayScene
    object_id: str

    @property
    def thing(self) -> HomeObject:
        """The object."""
        return self.home[self.object_id]

    @property
    def middle(self) -> Floats:
        """(3,) of the box around the object, m."""
        middle: Floats = self.thing.box_in_world.mean(axis=0)
        return middle

    def visible_fraction(self, places: Floats) -> Floats:
        """How much of the object can be seen from places [P,2]: [P] shares of its points."""
        eyes = camera_positions(self.home, places)
        points = _points_on(self.thing)
        origins = np.repeat(eyes[:, None], len(points), axis=1)
        rays = np.concatenate([origins, points[None] - origins], axis=-1)
        hits = self.scene.cast(rays.astype(np.float32))
        rows = self.scene.owners[np.where(np.isfinite(hits.distances), hits.triangles, 0)]
        share: Floats = (rows == self._row).mean(axis=1)
        return share

    def visible_px(self, look: Viewpoint, size: tuple[int, int] = SIZE_PX) -> int:
        """Pixels of the object in the view of a look."""
        camera = robot_camera(self.home, look, size)
        instances, _ = self.scene.instances(camera)
        return int((instances == self._row).sum())

    @property
    def _row(self) -> int:
        return [thing.id for thing in self.home.objects].index(self.object_id)


def camera_positions(home: Home, places: Floats) -> Floats:
    """[P,3] where the camera of the robot is at places [P,2], m."""
    height = home.space.box[0, 2] + CAMERA_HEIGHT_M
    return np.column_stack([places, np.full(len(places), height)])


def viewpoint_towards(
    home: Home, place: Floats, target: Floats, jitter_deg: NDArray[np.float64]
) -> Viewpoint:
    """The look from a place (2,) at a target (3,), turned by (2,) yaw and horizon, to 5 degrees."""
    way = target - camera_positions(home, place[None])[0]
    yaw_deg = np.rad2deg(np.arctan2(way[1], way[0]))
    horizon_deg = np.rad2deg(np.arctan2(-way[2], np.hypot(way[0], way[1])))
    yaw_deg, horizon_deg = (
        5.0 * np.round((angle + turn) / 5)
        for angle, turn in zip((yaw_deg, horizon_deg), jitter_deg, strict=True)
    )
    return Viewpoint.at(place, float(yaw_deg % 360), float(np.clip(horizon_deg, *HORIZON_DEG)))


def _points_on(thing: HomeObject) -> Floats:
    """[SAMPLES,3] points spread over the surface of an object, in the world, m."""
    corners = np.concatenate([surface.vertices[surface.faces] for surface in thing.surfaces])
    corners = corners @ thing.world_from_object[:3, :3].T + thing.world_from_object[:3, 3]
    areas = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    ends = np.cumsum(areas)
    picked = np.searchsorted(ends, (np.arange(SAMPLES) + 0.5) / SAMPLES * ends[-1])
    points: Floats = corners[np.minimum(picked, len(corners) - 1)].mean(axis=1)
    return points
