"""The triangles of a home, ready for rays: what is hit, and what is in between."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gslts.camera import Camera
from gslts.sim.home import Home

Floats32 = NDArray[np.float32]


class RayScene:
    """The shapes of a home, without their looks.

    Triangles are numbered through all surfaces of all objects.

    Args:
        home: Changes of the home need a new object.

    Attributes:
        owners: [T] int32, index of the object that each triangle belongs to.
        normals: [3,T] float32, unit vectors in the world; one plane for each coordinate.
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
        self.owners = np.concatenate(owners)
        all_normals = np.concatenate(normals).T
        lengths = np.linalg.norm(all_normals, axis=0)
        self.normals = (all_normals / np.maximum(lengths, 1e-20)).astype(np.float32)
        self._scene = open3d.t.geometry.RaycastingScene()
        self._scene.add_triangles(
            self._tensor(np.concatenate(vertices).astype(np.float32)),
            self._tensor(np.concatenate(faces).astype(np.uint32)),
        )

    def cast(self, origins: Floats32, directions: Floats32) -> dict[str, Any]:
        """What rays hit first.

        Args:
            origins: [3,h,W], m, or what can be broadcast to that.
            directions: [3,h,W], of any length.

        Returns:
            Open3D's `t_hit` [h,W], in lengths of the direction and infinite for a miss,
            `primitive_ids` [h,W] and barycentric `primitive_uvs` [h,W,2].
        """
        hits = self._scene.cast_rays(self._rays(origins, directions))
        return {name: hits[name].numpy() for name in ("t_hit", "primitive_ids", "primitive_uvs")}

    def blocked(self, origins: Floats32, ways: Floats32, end: float) -> NDArray[np.bool_]:
        """[h,W] whether anything is met on the first `end` (a share) of ways [3,h,W]."""
        rays = self._rays(origins, ways)
        result: NDArray[np.bool_] = self._scene.test_occlusions(rays, tnear=0.0, tfar=end).numpy()
        return result

    def instances(self, camera: Camera) -> tuple[NDArray[np.int32], Floats32]:
        """What is seen in each pixel, without light: indices [H,W] of objects (-1: none), depth."""
        eye = camera.world_from_camera[:3, 3].astype(np.float32)[:, None, None]
        hits = self.cast(eye, pixel_directions(camera))
        hit = np.isfinite(hits["t_hit"])
        rows = self.owners[np.where(hit, hits["primitive_ids"], 0)]
        depth = np.where(hit, hits["t_hit"], np.float32(0))
        return np.where(hit, rows, np.int32(-1)), depth

    def _rays(self, origins: Floats32, directions: Floats32) -> Any:
        rays = np.empty((*directions.shape[1:], 6), np.float32)
        rays[..., :3] = np.moveaxis(np.broadcast_to(origins, directions.shape), 0, -1)
        rays[..., 3:] = np.moveaxis(directions, 0, -1)
        return self._tensor(rays)


def pixel_directions(camera: Camera) -> Floats32:
    """[3,H,W] from the eye through the pixel centres, in world axes, with z = 1 in the camera."""
    columns = (np.arange(camera.width) + 0.5 - camera.cx) / camera.fx
    rows = (np.arange(camera.height) + 0.5 - camera.cy) / camera.fy
    right, down, ahead = camera.world_from_camera[:3, :3].T[:, :, None, None]
    directions: Floats32 = (right * columns + down * rows[:, None] + ahead).astype(np.float32)
    return directions
