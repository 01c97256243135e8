"""Intersection of rays with the triangles of a home."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gslts._core.sim import intersect_triangles, pixel_rays, visible_triangles
from gslts.core.camera import Camera
from gslts.types import Bools, Floats32, Ints32
from gslts_sim.home import Home


@dataclass(frozen=True, eq=False)
class Hits:
    """First hits of rays.

    Args:
        distances: [...] float32, in lengths of the ray's direction; infinite for a miss.
        triangles: [...] uint32, index of the triangle; 0xffffffff for a miss.
        weights: [...,2] float32, barycentric, of the second and third corner.
    """

    distances: Floats32
    triangles: NDArray[np.uint32]
    weights: Floats32


def require_embree() -> None:
    """Require the package without which there are no simulated homes.

    Raises:
        ImportError: It is not installed.
    """
    try:
        import embreex.rtcore_scene  # noqa: F401
    except ImportError as error:
        raise ImportError(
            "simulated homes need Embree (x86-64): pip install 'gslts[sim]'"
        ) from error


class RayScene:
    """Ray-casting structure of the triangles of a home, without textures and light.

    Triangles are numbered through all surfaces of all objects.

    Args:
        home: The home; each of its states needs a structure of its own.
        threads: Number of threads; 0 for one per hardware thread.

    Attributes:
        owners: [T] int32, index of the object of each triangle.
        normals: [T,3] float32, unit vectors in the world.
    """

    def __init__(self, home: Home, threads: int = 0) -> None:
        require_embree()
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        self._threads = threads
        vertices, faces, owners, normals = [], [], [], []
        first_vertex = 0
        for index, obj in enumerate(home.objects):
            rotation, center = obj.world_from_object[:3, :3], obj.world_from_object[:3, 3]
            for surface in obj.surfaces:
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
        self._scene: Any = EmbreeScene()
        TriangleMesh(self._scene, all_vertices, all_faces)

    def cast(self, rays: Floats32) -> Hits:
        """Find the first triangle that each ray hits.

        Args:
            rays: [...,6] float32: origin, m, and direction of any length, in the world.
        """
        triangles = self._run(rays, "INTERSECT").astype(np.uint32)
        return self._hits(rays, triangles.reshape(rays.shape[:-1]))

    def cast_pixels(self, camera: Camera, rays: Floats32) -> Hits:
        """Find the first triangle that each ray of a camera hits; faster than `cast`.

        Args:
            camera: The camera.
            rays: [H,W,6] float32, its `pixel_rays`.
        """
        triangles = visible_triangles(camera, self._corners, threads=self._threads)
        return self._hits(rays, triangles)

    def _hits(self, rays: Floats32, triangles: NDArray[np.uint32]) -> Hits:
        # The last bits of Embree's distances and weights depend on the processor.
        distances, weights = intersect_triangles(
            rays.reshape(-1, 6), triangles.ravel(), self._corners, threads=self._threads
        )
        shape = triangles.shape
        return Hits(distances.reshape(shape), triangles, weights.reshape(*shape, 2))

    def blocked(self, rays: Floats32, end: float) -> Bools:
        """Test whether rays are blocked.

        Args:
            rays: [...,6] float32: origin, m, and direction.
            end: Fraction of the direction up to which obstacles count.

        Returns:
            [...] bool.
        """
        ends = np.full(rays.size // 6, end, np.float32)
        blocked: Bools = self._run(rays, "OCCLUDED", dists=ends) == 0
        return blocked.reshape(rays.shape[:-1])

    def _run(self, rays: Floats32, query: str, **arguments: Floats32) -> Ints32:
        origins, directions = (
            np.ascontiguousarray(part) for part in np.split(rays.reshape(-1, 6), 2, 1)
        )
        found: Ints32 = self._scene.run(origins, directions, query=query, **arguments)
        return found

    def instances(self, camera: Camera) -> tuple[Ints32, Floats32]:
        """Render objects and depth, without light.

        Args:
            camera: The camera.

        Returns:
            [H,W] int32 indices of objects, -1 for none; and [H,W] float32 depth, m, 0 for none.
        """
        hits = self.cast_pixels(camera, pixel_rays(camera, threads=self._threads))
        hit = np.isfinite(hits.distances)
        rows = self.owners[np.where(hit, hits.triangles, 0)]
        depth = np.where(hit, hits.distances, np.float32(0))
        return np.where(hit, rows, np.int32(-1)), depth
