"""From where a thing can be seen, as the map of Gaussians shows it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gslts.core.camera import Camera, at_pose, downscale, look_at
from gslts.core.gaussian_map import GaussianMap
from gslts.navigation.visibility import aim, seen
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.semantics.queries import Instance
from gslts.types import Floats

MOST_POINTS = 400
"""Of a thing that are looked for."""
LEAST_POINTS, LEAST_SHARE = 4, 0.1
"""Points of a thing, and share of them, that count as seeing it."""
WIDTH_PX = 160
"""Of the images that are rendered to find out."""


@dataclass(frozen=True, eq=False)
class Thing:
    """What the robot goes to.

    Attributes:
        points: [P,3] on it, in the world, m.
    """

    points: Floats

    @classmethod
    def of(cls, gaussian_map: GaussianMap, instance: Instance) -> Thing:
        """Of the Gaussians of an instance that are in its box, evenly some."""
        points = gaussian_map.means[instance.rows] + gaussian_map.origin
        inside = ((points >= instance.low) & (points <= instance.high)).all(axis=1)
        points = points[inside] if inside.any() else points
        return cls(points[:: max(1, len(points) // MOST_POINTS)])

    def distances_m(self, places: Floats) -> Floats:
        """[K] along the floor, from places [K,2] to the nearest point of it."""
        ways = places[:, None] - self.points[None, :, :2]
        metres: Floats = np.linalg.norm(ways, axis=2).min(axis=1)
        return metres


@dataclass(frozen=True, eq=False)
class Outlook:
    """How a thing is seen from a place.

    Attributes:
        yaw_rad: Direction in which to look, from x to y.
        pitch_rad: Below the horizon.
        seen: [P] which of its points are seen.
    """

    yaw_rad: float
    pitch_rad: float
    seen: NDArray[np.bool_]

    @property
    def enough(self) -> bool:
        """Whether that counts as seeing it."""
        return bool(self.seen.sum() >= max(LEAST_POINTS, LEAST_SHARE * len(self.seen)))


class Lookout:
    """Renders what a robot would see from elsewhere.

    Args:
        gaussian_map: float32.
        camera: The robot's, wherever it is; only its height and its lens count.
    """

    def __init__(self, gaussian_map: GaussianMap, camera: Camera) -> None:
        size = gaussian_map.size
        self._map = replace(  # Of colours, none; of features, none: only depth is wanted.
            gaussian_map,
            features=np.zeros((size, 0), gaussian_map.dtype),
            sh=gaussian_map.sh[:, :1],
        )
        self._rasterizer, self._options = Rasterizer(gaussian_map.dtype), RenderOptions(threads=1)
        self._lens = downscale(camera, max(1, camera.width // WIDTH_PX))
        self._eye_m = float(camera.world_from_camera[2, 3])

    def outlook(self, place: Floats, thing: Thing) -> Outlook:
        """How a robot at a place (2,), x and y, m, would see a thing if it looked at it."""
        eye = np.array([*place, self._eye_m])
        target = thing.points.mean(axis=0)
        found = self._seen(eye, target, thing)
        if found.any():  # What is seen of a large thing may be far from its middle.
            target = thing.points[found].mean(axis=0)
            found = self._seen(eye, target, thing)
        yaw_rad, pitch_rad = aim(eye, target)
        return Outlook(yaw_rad, pitch_rad, found)

    def _seen(self, eye: Floats, target: Floats, thing: Thing) -> NDArray[np.bool_]:
        if np.linalg.norm(target[:2] - eye[:2]) < 1e-3:  # Straight down has no direction.
            target = target + np.array([1e-2, 0, 0])
        camera = at_pose(self._lens, look_at(eye, target))
        images = self._rasterizer.forward(self._map, camera, self._options)
        return seen(thing.points, camera, images.depth)
