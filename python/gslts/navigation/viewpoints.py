"""Viewpoints from which an object is visible, by rendering the map."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil

import cv2
import numpy as np

from gslts.core.camera import Camera, at_pose, downscale, look_at
from gslts.core.gaussian_map import GaussianMap
from gslts.navigation.visibility import view_angles, visible_points
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.semantics.queries import FLANN_KDTREE_SINGLE, Instance
from gslts.store.causes import Box
from gslts.types import Bools, Floats

MAX_POINTS = 400
"""Maximum number of points of an object whose visibility is tested; bounds time."""
MIN_LOGIT_OPACITY = 0.0
"""Minimum opacity of the Gaussians of a box, before the sigmoid: a half."""
MIN_VISIBLE_POINTS, MIN_VISIBLE_SHARE = 4, 0.1
"""Minimum number of visible points of an object, and share of its points, at a viewpoint of it."""
WIDTH_PX = 160
"""Width of the depth images that are rendered to test visibility; bounds time."""


@dataclass(frozen=True, eq=False)
class Target:
    """An object to navigate to.

    Attributes:
        points: [P,3] points on the object, world, m.
    """

    points: Floats

    @classmethod
    def of_instance(cls, gaussian_map: GaussianMap, instance: Instance) -> Target:
        """Make a target of the Gaussians of an instance that are in its box, evenly sampled.

        Args:
            gaussian_map: The map of the instance.
            instance: Result of a query.

        Returns:
            The target.
        """
        points = gaussian_map.means[instance.rows] + gaussian_map.origin
        inside = ((points >= instance.low) & (points <= instance.high)).all(axis=1)
        return cls(_sample(points[inside] if inside.any() else points))

    @classmethod
    def in_box(cls, gaussian_map: GaussianMap, box: Box) -> Target:
        """Make a target of all visible Gaussians in a box, evenly sampled.

        Args:
            gaussian_map: Any map.
            box: Lower and upper corner in the world, m.

        Returns:
            The target.

        Raises:
            ValueError: The box is empty.
        """
        low, high = np.array(box[0]), np.array(box[1])
        rows = gaussian_map.rows_in_box(low, high)
        points = gaussian_map.means[rows] + gaussian_map.origin
        inside = ((points >= low) & (points <= high)).all(axis=1)
        inside &= gaussian_map.logit_opacities[rows] >= MIN_LOGIT_OPACITY
        if not inside.any():
            raise ValueError("the map shows nothing there any more")
        return cls(_sample(points[inside]))

    def distances_m(self, positions: Floats, max_m: float = np.inf) -> Floats:
        """Compute distances along the floor to the nearest point of the object.

        Args:
            positions: [K,2] x and y in the world, m.
            max_m: Larger distances may be infinite, which saves time, m.

        Returns:
            [K] m.
        """
        points = self.points[:, :2]
        low, high = points.min(axis=0), points.max(axis=0)
        near = ((positions >= low - max_m) & (positions <= high + max_m)).all(axis=1)
        distances = np.full(len(positions), np.inf)
        if near.any():
            points, others = ((xy - low).astype(np.float32) for xy in (points, positions[near]))
            tree = cv2.flann.Index(points, {"algorithm": FLANN_KDTREE_SINGLE})
            squares = tree.knnSearch(others, 1, params={})[1]
            distances[near] = np.sqrt(squares[:, 0])
        return distances


def _sample(points: Floats) -> Floats:
    return points[:: max(1, ceil(len(points) / MAX_POINTS))]


@dataclass(frozen=True, eq=False)
class TargetView:
    """View of an object from a position.

    Attributes:
        yaw_rad: Direction of the camera about z, from x to y, rad.
        pitch_rad: Angle of the camera below the horizon, rad.
        visible: [P] bool, points of the object that are visible.
    """

    yaw_rad: float
    pitch_rad: float
    visible: Bools

    @property
    def is_sufficient(self) -> bool:
        """True if enough points are visible."""
        return bool(
            self.visible.sum() >= max(MIN_VISIBLE_POINTS, MIN_VISIBLE_SHARE * len(self.visible))
        )


class ViewpointRenderer:
    """Renders what a robot would see from other positions.

    Args:
        gaussian_map: float32.
        camera: Camera of the robot; its intrinsics and its height are used.
    """

    def __init__(self, gaussian_map: GaussianMap, camera: Camera) -> None:
        size = gaussian_map.size
        self._map = replace(  # Only depth is rendered: without features, SH of degree 0.
            gaussian_map,
            features=np.zeros((size, 0), gaussian_map.dtype),
            sh=gaussian_map.sh[:, :1],
        )
        self._rasterizer, self._options = Rasterizer(gaussian_map.dtype), RenderOptions(threads=1)
        self._camera = downscale(camera, max(1, camera.width // WIDTH_PX))
        self._eye_height_m = float(camera.world_from_camera[2, 3])

    def view(self, position: Floats, target: Target) -> TargetView:
        """Compute the view of a target from a position.

        Args:
            position: (2,) x and y in the world, m.
            target: The object to look at.

        Returns:
            The direction in which most of the target is visible, and its visible points.
        """
        eye = np.array([*position, self._eye_height_m])
        point = target.points.mean(axis=0)
        visible = self._visible(eye, point, target)
        if visible.any():  # The visible part of a large object may be far from its centre.
            point = target.points[visible].mean(axis=0)
            visible = self._visible(eye, point, target)
        yaw_rad, pitch_rad = view_angles(eye, point)
        return TargetView(yaw_rad, pitch_rad, visible)

    def _visible(self, eye: Floats, point: Floats, target: Target) -> Bools:
        if np.linalg.norm(point[:2] - eye[:2]) < 1e-3:  # A vertical view has no yaw.
            point = point + np.array([1e-2, 0, 0])
        camera = at_pose(self._camera, look_at(eye, point))
        images = self._rasterizer.forward(self._map, camera, self._options)
        return visible_points(target.points, camera, images.depth)
