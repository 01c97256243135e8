"""What a camera in a home sees: radiance, depth and instances, by casting rays.

Direct light from area lights with soft shadows, and ambient light, on diffuse textured surfaces.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gslts.camera import Camera
from gslts.sim.home import AreaLight, Home
from gslts.sim.texture_atlas import TextureAtlas

Floats32 = NDArray[np.float32]

SHADOW_OFFSET_M = 1e-3
"""Shadow rays start this far off the surface, so that it does not shade itself."""
PATTERN = 4
"""Light samples differ in tiles of 4 x 4 pixels and are averaged over them afterwards."""


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
    """

    def __init__(self, home: Home) -> None:
        import open3d

        self._tensor: Any = open3d.core.Tensor
        vertices, faces, owners, normals = [], [], [], []
        first_vertex = 0
        for index, thing in enumerate(home.objects):
            rotation, center = thing.world_from_object[:3, :3], thing.world_from_object[:3, 3]
            for surface in thing.surfaces:
                in_world = surface.vertices @ rotation.T + center
                corners = in_world[surface.faces]
                normals.append(
                    np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
                )
                vertices.append(in_world)
                faces.append(surface.faces + first_vertex)
                owners.append(np.full(len(surface.faces), index, np.int32))
                first_vertex += len(in_world)
        self.home = home
        self._owners = np.concatenate(owners)
        all_normals = np.concatenate(normals)
        lengths = np.linalg.norm(all_normals, axis=1, keepdims=True)
        self._normals = (all_normals / np.maximum(lengths, 1e-20)).astype(np.float32)
        surfaces = [surface for thing in home.objects for surface in thing.surfaces]
        self._atlas = TextureAtlas(surfaces)
        self._scene = open3d.t.geometry.RaycastingScene()
        self._scene.add_triangles(
            self._tensor(np.concatenate(vertices).astype(np.float32)),
            self._tensor(np.concatenate(faces).astype(np.uint32)),
        )

    def look(self, camera: Camera) -> View:
        """Renders one view."""
        height, width = camera.height, camera.width
        directions = _pixel_directions(camera)
        eye = camera.world_from_camera[:3, 3].astype(np.float32)
        rays = np.concatenate([np.broadcast_to(eye, directions.shape), directions], axis=-1)
        hits = self._scene.cast_rays(self._tensor(rays))
        # Directions have z = 1 in the camera frame, so that the distance is the depth.
        depth = hits["t_hit"].numpy()
        hit = np.isfinite(depth)
        depth = np.where(hit, depth, np.float32(0))
        triangles = np.where(hit, hits["primitive_ids"].numpy(), 0)
        normals = self._normals[triangles]
        cosines = np.einsum("hwc,hwc->hw", normals, directions)
        lengths = np.linalg.norm(directions, axis=-1)
        cosines /= lengths
        normals *= -np.sign(cosines)[..., None]  # Surfaces are seen from both sides.
        cosines = np.abs(cosines)
        pixel_m = depth * np.float32(1 / camera.fx) / np.maximum(cosines, 0.1)
        albedo = self._atlas.sample(triangles, hits["primitive_uvs"].numpy(), pixel_m)
        points = eye + directions * depth[..., None]
        irradiance = self._irradiance(points, normals, depth)
        radiance = np.where(hit[..., None], albedo * irradiance, np.float32(0))
        instances = np.where(hit, self._owners[triangles], -1).astype(np.int32)
        assert radiance.shape == (height, width, 3)
        return View(radiance, depth, instances, np.where(hit, cosines, np.float32(0)))

    def _irradiance(self, points: Floats32, normals: Floats32, depth: Floats32) -> Floats32:
        """[H,W,3] light on the surfaces, as the value of a white one."""
        direct = np.zeros_like(points)
        for light in self.home.lights:
            direct += self._from_light(light, points, normals)
        if self.home.lights:
            direct = _average_over_pattern(direct, normals, depth)
        return direct + self.home.ambient.astype(np.float32)

    def _from_light(self, light: AreaLight, points: Floats32, normals: Floats32) -> Floats32:
        """One sample of the light a pixel, another one in each pixel of the pattern."""
        normal = np.cross(light.edge_u, light.edge_v)
        area = float(np.linalg.norm(normal))
        u, v = _stratified(points.shape[:2])
        on_light = (
            light.center.astype(np.float32)
            + (u - 0.5)[..., None] * light.edge_u.astype(np.float32)
            + (v - 0.5)[..., None] * light.edge_v.astype(np.float32)
        )
        start = points + SHADOW_OFFSET_M * normals
        towards = on_light - start
        squared = np.einsum("hwc,hwc->hw", towards, towards)
        at_surface = np.einsum("hwc,hwc->hw", towards, normals)
        at_light = -(towards @ (normal / area).astype(np.float32))
        # Lambert's law at both ends; the solid angle of a half-space, seen by cosine, is pi.
        factor = np.maximum(at_surface, 0) * np.maximum(at_light, 0) * np.float32(area / np.pi)
        factor /= np.maximum(squared * squared, np.float32(1e-6))
        rays = np.concatenate([start, towards], axis=-1)
        # The light's own lamp must not shade it.
        occluded = self._scene.test_occlusions(self._tensor(rays), tnear=0.0, tfar=0.98)
        factor[occluded.numpy()] = 0
        result: Floats32 = factor[..., None] * light.radiance.astype(np.float32)
        return result


def _pixel_directions(camera: Camera) -> Floats32:
    """[H,W,3] from the eye through the pixel centres, in world axes, with z = 1 in the camera."""
    columns = (np.arange(camera.width) + 0.5 - camera.cx) / camera.fx
    rows = (np.arange(camera.height) + 0.5 - camera.cy) / camera.fy
    x, y = np.meshgrid(columns, rows)
    in_camera = np.stack([x, y, np.ones_like(x)], axis=-1)
    return (in_camera @ camera.world_from_camera[:3, :3].T).astype(np.float32)


def _stratified(shape: tuple[int, int]) -> tuple[Floats32, Floats32]:
    """Places on a light in 0 to 1, [H,W] each: a grid over every tile of the pattern.

    The pixels next to each other take places far from each other.
    """
    order = np.array([0, 2, 3, 1])
    i, j = np.meshgrid(order, order, indexing="ij")
    u = ((i + 0.5) / PATTERN).astype(np.float32)
    v = (((j + i) % PATTERN + 0.5) / PATTERN).astype(np.float32)
    repeats = (shape[0] // PATTERN + 1, shape[1] // PATTERN + 1)
    return (
        np.tile(u, repeats)[: shape[0], : shape[1]],
        np.tile(v, repeats)[: shape[0], : shape[1]],
    )


def _average_over_pattern(values: Floats32, normals: Floats32, depth: Floats32) -> Floats32:
    """Means over PATTERN x PATTERN pixels of the same surface: first along rows, then columns."""
    for axis in (1, 0):
        total = values.copy()
        weight = np.ones(depth.shape, np.float32)
        for shift in (-2, -1, 1):
            here, there = _overlap(shift, axis)
            same = np.einsum("hwc,hwc->hw", normals[here], normals[there]) > 0.9
            same &= np.abs(depth[here] - depth[there]) < 0.02 * depth[here] * abs(shift)
            total[here] += values[there] * same[..., None]
            weight[here] += same
        values = total / weight[..., None]
    return values


def _overlap(shift: int, axis: int) -> tuple[Any, Any]:
    """Slices of the pixels that have a neighbour `shift` further along the axis, and of those."""
    here = slice(max(0, -shift), -shift if shift > 0 else None)
    there = slice(max(0, shift), shift if shift < 0 else None)
    return (
        ((here, slice(None)), (there, slice(None)))
        if axis == 0
        else (
            (slice(None), here),
            (slice(None), there),
        )
    )
