"""The triangles of a home, ready for rays: what is hit, and what is in between."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gslts._core.sim import intersect_triangles, pixel_rays
from gslts.core.camera import Camera
from gslts.types import Floats32
from gslts_sim.home import Home


@dataclass(frozen=True, eq=False)
class Hits:
    """First hits of rays.

    Attributes:
        distances: [...] float32, in lengths of the ray's direction; infinite for a miss.
        triangles: [...] uint32, index of the triangle; 0xffffffff for a miss.
        weights: [...,2] float32, barycentric, of the second and third corner.
    """

    distances: Floats32
    triangles: NDArray[np.uint32]
    weights: Floats32


class RayScene:
    """The shapes of a home, without their looks.

    Triangles are numbered through all surfaces of all objects.

    Args:
        home: Changes of the home need a new object.
        threads: 0 means one a hardware thread.

    Attributes:
        owners: [T] int32, index of the object that each triangle belongs to.
        normals: [T,3] float32, unit vectors in the world.
    """

    def __init__(self, home: Home, threads: int = 0) -> None:
        import open3d

        self._tensor: Any = open3d.core.Tensor
        self._threads = threads
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
        self.owners = np.concatenate(owners)
        all_normals = np.concatenate(normals)
        lengths = np.linalg.norm(all_normals, axis=1, keepdims=True)
        self.normals: Floats32 = (all_normals / np.maximum(lengths, 1e-20)).astype(np.float32)
        all_vertices = np.concatenate(vertices).astype(np.float32)
        all_faces = np.concatenate(faces).astype(np.uint32)
        self._corners: Floats32 = all_vertices[all_faces]
        self._scene = open3d.t.geometry.RaycastingScene()
        self._scene.add_triangles(self._tensor(all_vertices), self._tensor(all_faces))

    def cast(self, rays: Floats32) -> Hits:
        """Find the first triangle that each ray hits.

        Args:
            rays: [...,6] float32 origins, m, and directions of any length, world.
        """
        found = self._scene.cast_rays(self._tensor(rays), self._threads)
        triangles = found["primitive_ids"].numpy()
        # Embree's distances and weights have other last bits on processors of other makers.
        distances, weights = intersect_triangles(
            rays.reshape(-1, 6), triangles.ravel(), self._corners, threads=self._threads
        )
        shape = triangles.shape
        return Hits(distances.reshape(shape), triangles, weights.reshape(*shape, 2))

    def blocked(self, rays: Floats32, end: float) -> NDArray[np.bool_]:
        """[...] whether rays [...,6] meet anything on the first `end` (a share) of their ways."""
        result: NDArray[np.bool_] = self._scene.test_occlusions(
            self._tensor(rays), tnear=0.0, tfar=end, nthreads=self._threads
        ).numpy()
        return result

    def instances(self, camera: Camera) -> tuple[NDArray[np.int32], Floats32]:
        """What is seen in each pixel, without light: indices [H,W] of objects (-1: none), depth."""
        hits = self.cast(pixel_rays(camera, threads=self._threads))
        hit = np.isfinite(hits.distances)
        rows = self.owners[np.where(hit, hits.triangles, 0)]
        depth = np.where(hit, hits.distances, np.float32(0))
        return np.where(hit, rows, np.int32(-1)), depth
