"""What a camera in a home sees: radiance, depth and instances, by casting rays.

Direct light from area lights with soft shadows, and ambient light, on diffuse textured surfaces.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gslts._core import sim as core_sim
from gslts.core.camera import Camera
from gslts.types import Floats32
from gslts_sim.home import AreaLight, Home
from gslts_sim.ray_scene import RayScene
from gslts_sim.texture_atlas import LINEAR_OF_BYTE, texture_atlas

SHADOW_END = 0.98
"""Share of the way to a light that must be free: its own lamp must not shade it."""


@dataclass(frozen=True, eq=False)
class View:
    """What an ideal camera measures.

    Attributes:
        radiance: [H,W,3] float32, linear RGB; 1 is a white surface in full light.
        depth: [H,W] float32, z in the camera frame, m; 0 where nothing was hit.
        instances: [H,W] int32, index into the objects of the home; -1 where nothing was hit.
        cosines: [H,W] float32, between surface normal and ray; 0 where nothing was hit.
    """

    radiance: Floats32
    depth: Floats32
    instances: NDArray[np.int32]
    cosines: Floats32


class RayCaster:
    """Renders views of a home.

    Args:
        home: Changes of the home need a new object.
        lights: The lights that are on; None means all of its lights.
        threads: 0 means one a hardware thread; the result does not depend on it.
    """

    def __init__(
        self, home: Home, lights: tuple[AreaLight, ...] | None = None, threads: int = 0
    ) -> None:
        self.home = home
        self.lights = home.all_lights if lights is None else lights
        self._threads = threads
        self._scene = RayScene(home, threads)
        surfaces = [surface for thing in home.objects for surface in thing.surfaces]
        shining = {light.owner for light in self.lights}
        glow = [
            surface.emission if thing.id in shining else 0.0
            for thing in home.objects
            for surface in thing.surfaces
        ]
        self._surfaces = core_sim.Surfaces(
            normals=self._scene.normals,
            objects=self._scene.owners,
            emission=np.repeat(np.array(glow, np.float32), [len(s.faces) for s in surfaces]),
            linear_of_byte=LINEAR_OF_BYTE,
            **texture_atlas(surfaces),
        )
        self._lights = np.array(
            [(s.center, s.edge_u, s.edge_v, s.radiance) for s in self.lights], np.float64
        ).reshape(-1, 4, 3)

    def render(self, camera: Camera) -> View:
        """Renders one view."""
        rays = core_sim.pixel_rays(camera, threads=self._threads)
        hits = self._scene.cast(rays)
        shading = core_sim.Shading(
            self._surfaces,
            rays,
            hits.distances,
            hits.triangles,
            hits.weights,
            pixel_rad=1 / camera.fx,
            lights=self._lights,
            threads=self._threads,
        )
        blocked = self._scene.blocked(shading.shadow_rays, SHADOW_END)
        return View(
            shading.radiance(blocked, self.home.ambient),
            shading.depth,
            shading.objects,
            shading.cosines,
        )
