"""What a camera in a home sees: radiance, depth and instances, by casting rays.

Direct light from area lights with soft shadows, and ambient light, on diffuse textured surfaces.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gslts.camera import Camera
from gslts.sim.home import AreaLight, Home
from gslts.sim.ray_scene import RayScene, pixel_directions
from gslts.sim.texture_atlas import TextureAtlas

Floats32 = NDArray[np.float32]

SHADOW_OFFSET_M = 1e-3
"""Shadow rays start this far off the surface, so that it does not shade itself."""
PATTERN = 4
"""Light samples differ in tiles of 4 x 4 pixels and are averaged over them afterwards."""
BAND_ROWS = 60
"""An image is made in bands, each small enough for a core's cache."""
HALO_ROWS = 2
"""Rows beyond a band over which its light is averaged."""


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
    """A home, ready to be looked at.

    Args:
        home: Changes of the home need a new object.
        lights: What shines; None means all of its lights.
    """

    def __init__(self, home: Home, lights: tuple[AreaLight, ...] | None = None) -> None:
        self.home = home
        self.lights = home.all_lights if lights is None else lights
        self._scene = RayScene(home)
        surfaces = [surface for thing in home.objects for surface in thing.surfaces]
        self._atlas = TextureAtlas(surfaces)
        shining = {light.owner for light in self.lights}
        glow = [
            surface.emission if thing.id in shining else 0.0
            for thing in home.objects
            for surface in thing.surfaces
        ]
        self._emission = np.repeat(np.array(glow, np.float32), [len(s.faces) for s in surfaces])

    def look(self, camera: Camera) -> View:
        """Renders one view."""
        starts = range(0, camera.height, BAND_ROWS)
        bands = [self._band(camera, row) for row in starts]
        return View(
            *(
                np.concatenate([getattr(band, name) for band in bands])
                for name in ("radiance", "depth", "instances", "cosines")
            )
        )

    def _band(self, camera: Camera, row: int) -> View:
        """The rows from `row` on. Inside, each coordinate and colour is a plane of its own."""
        first, end = max(0, row - HALO_ROWS), min(camera.height, row + BAND_ROWS + HALO_ROWS)
        part = camera.cropped(0, first, camera.width, end)
        directions = pixel_directions(part)
        eye = camera.world_from_camera[:3, 3].astype(np.float32)[:, None, None]
        hits = self._scene.cast(eye, directions)
        # Directions have z = 1 in the camera frame, so that the distance is the depth.
        depth = hits["t_hit"]
        hit = np.isfinite(depth)
        depth = np.where(hit, depth, np.float32(0))
        triangles = np.where(hit, hits["primitive_ids"], 0)
        normals = np.take(self._scene.normals, triangles, axis=1)
        cosines = _dot(normals, directions) / np.sqrt(_dot(directions, directions))
        normals *= -np.sign(cosines)  # Surfaces are seen from both sides.
        cosines = np.abs(cosines)
        per_px = np.float32(1 / camera.fx)
        pixel_m = (depth * per_px / np.maximum(cosines, 0.1)).astype(np.float32)
        uvs = hits["primitive_uvs"]
        albedo = self._atlas.sample(triangles, uvs[..., 0], uvs[..., 1], pixel_m)
        light = self._irradiance(eye + directions * depth, normals, depth, first)
        radiance = albedo * (light + np.take(self._emission, triangles)) * hit
        kept = slice(row - first, row - first + min(BAND_ROWS, camera.height - row))
        return View(
            np.ascontiguousarray(np.moveaxis(radiance[:, kept], 0, -1)),
            depth[kept],
            np.where(hit, self._scene.owners[triangles], -1).astype(np.int32)[kept],
            np.where(hit, cosines, np.float32(0))[kept],
        )

    def _irradiance(
        self, points: Floats32, normals: Floats32, depth: Floats32, row: int
    ) -> Floats32:
        """[3,h,W] light on the surfaces of rows from `row` on, as the value of a white one."""
        direct = np.zeros_like(points)
        for light in self.lights:
            factor = self._from_light(light, points, normals, row)
            direct += factor * light.radiance.astype(np.float32)[:, None, None]
        if self.lights:
            direct = _average_over_pattern(direct, normals, depth)
        return direct + self.home.ambient.astype(np.float32)[:, None, None]

    def _from_light(
        self, light: AreaLight, points: Floats32, normals: Floats32, row: int
    ) -> Floats32:
        """[h,W] light for a radiance of 1, from one place on the light a pixel."""
        cross = np.cross(light.edge_u, light.edge_v)
        area = float(np.linalg.norm(cross))
        center, edge_u, edge_v, normal = (
            vector.astype(np.float32)[:, None, None]
            for vector in (light.center, light.edge_u, light.edge_v, cross / area)
        )
        u, v = _stratified(points.shape[1:], row)
        start = points + SHADOW_OFFSET_M * normals
        towards = center + (u - 0.5) * edge_u + (v - 0.5) * edge_v - start
        # Lambert's law at both ends; the solid angle of a half-space, seen by cosine, is pi.
        factor = np.maximum(_dot(towards, normals), 0) * np.maximum(-_dot(towards, normal), 0)
        factor *= np.float32(area / np.pi)
        factor /= np.maximum(_dot(towards, towards) ** 2, np.float32(1e-6))
        # The light's own lamp must not shade it.
        factor *= ~self._scene.blocked(start, towards, 0.98)
        result: Floats32 = factor
        return result


def _dot(a: Floats32, b: Floats32) -> Floats32:
    """[...] scalar products of vectors in planes [3,...]."""
    result: Floats32 = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    return result


def _stratified(shape: tuple[int, ...], row: int) -> tuple[Floats32, Floats32]:
    """Places on a light in 0 to 1, [h,W] each: a grid over every tile of the pattern.

    The pixels next to each other take places far from each other.
    """
    order = np.array([0, 2, 3, 1])
    rows, columns = (row + np.arange(shape[0])) % PATTERN, np.arange(shape[1]) % PATTERN
    i, j = np.meshgrid(order[rows], order[columns], indexing="ij")
    u = ((i + 0.5) / PATTERN).astype(np.float32)
    v = (((j + i) % PATTERN + 0.5) / PATTERN).astype(np.float32)
    return u, v


def _average_over_pattern(values: Floats32, normals: Floats32, depth: Floats32) -> Floats32:
    """Means [3,h,W] over PATTERN x PATTERN pixels of one surface: along rows, then columns."""
    for axis in (1, 0):
        total = values.copy()
        weight = np.ones(depth.shape, np.float32)
        for shift in (-2, -1, 1):
            here, there = _overlap(shift, axis)
            same = _dot(normals[:, *here], normals[:, *there]) > 0.9
            same &= np.abs(depth[here] - depth[there]) < 0.02 * abs(shift) * depth[here]
            total[:, *here] += values[:, *there] * same
            weight[here] += same
        values = total / weight
    return values


def _overlap(shift: int, axis: int) -> tuple[tuple[slice, slice], tuple[slice, slice]]:
    """Slices of the pixels that have a neighbour `shift` further along the axis, and of those."""
    here = slice(max(0, -shift), -shift if shift > 0 else None)
    there = slice(max(0, shift), shift if shift < 0 else None)
    if axis == 0:
        return (here, slice(None)), (there, slice(None))
    return (slice(None), here), (slice(None), there)
