"""Rendering of a home by rasterization and shadow rays: radiance, depth and instances.

Direct light from area lights with soft shadows, and ambient light, on diffuse textured surfaces.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gslts._core import sim as core_sim
from gslts.core.camera import Camera
from gslts.types import Floats32, Ints32
from gslts_sim.home import AreaLight, Home
from gslts_sim.ray_scene import RayScene
from gslts_sim.texture_atlas import LINEAR_OF_BYTE, texture_atlas

SHADOW_END = 0.98
"""Fraction of a shadow ray that is tested: the lamp that holds the light must not shade it."""


@dataclass(frozen=True, eq=False)
class View:
    """Noise-free measurements of a camera.

    Args:
        radiance: [H,W,3] float32, linear RGB; 1 is a white surface in full light.
        depth: [H,W] float32, z in the camera frame, m; 0 where nothing was hit.
        instances: [H,W] int32, index into the objects of the home; -1 where nothing was hit.
        cosines: [H,W] float32, between surface normal and ray; 0 where nothing was hit.
    """

    radiance: Floats32
    depth: Floats32
    instances: Ints32
    cosines: Floats32


class RayCaster:
    """Renders views of a home.

    Args:
        home: The home; each of its states needs a ray caster of its own.
        lights: Lights that are on; None for all lights of the home.
        threads: Number of threads; 0 for one per hardware thread. Results do not depend on it.
    """

    def __init__(
        self, home: Home, lights: tuple[AreaLight, ...] | None = None, threads: int = 0
    ) -> None:
        self.home = home
        self.lights = home.all_lights if lights is None else lights
        self._threads = threads
        self._scene = RayScene(home, threads)
        surfaces = [surface for obj in home.objects for surface in obj.surfaces]
        shining = {light.owner for light in self.lights}
        glow = [
            surface.emission if obj.id in shining else 0.0
            for obj in home.objects
            for surface in obj.surfaces
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
        """Render a view.

        Args:
            camera: The camera.
        """
        rays = core_sim.pixel_rays(camera, threads=self._threads)
        hits = self._scene.cast_pixels(camera, rays)
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
