"""Writing of homes as GLB files, which glTF viewers show and `load_home` reads."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from gslts.io.atomic_files import write_atomic
from gslts.io.gltf_file import Z_UP
from gslts_sim.gltf.library import import_trimesh
from gslts_sim.home import Home, HomeObject
from gslts_sim.mesh import Surface


def write_glb(home: Home, path: str | os.PathLike[str]) -> None:
    """Write a home atomically as a GLB with one named node per object.

    `extras` hold the type, whether it is movable or a receptacle and, on a floor, the type of the
    room. Boxes, parents and lights are not written.

    Args:
        home: The home.
        path: Of the file.

    Raises:
        ImportError: trimesh is missing.
        OSError: The file cannot be written.
    """
    trimesh = import_trimesh()

    scene: Any = trimesh.Scene()
    materials: dict[int, Any] = {}
    for obj in home.objects:
        pose = Z_UP.T @ obj.world_from_object @ Z_UP
        scene.graph.update(obj.id, matrix=pose, metadata=_extras(home, obj))
        for k, surface in enumerate(obj.surfaces):
            scene.add_geometry(
                _mesh(surface, materials),
                node_name=f"{obj.id} {k}",
                geom_name=f"{obj.id} {k}",
                parent_node_name=obj.id,
            )
    write_atomic(Path(path), scene.export(file_type="glb"))


def _extras(home: Home, obj: HomeObject) -> dict[str, Any]:
    extras: dict[str, Any] = {
        "type": obj.type,
        "movable": obj.movable,
        "receptacle": obj.receptacle,
    }
    middle = obj.box_in_world.mean(axis=0)[:2]
    if obj.type == "Floor":
        for room in home.rooms:
            if (room.box[0, :2] <= middle).all() and (middle <= room.box[1, :2]).all():
                extras["room"] = room.type
    return extras


def _mesh(surface: Surface, materials: dict[int, Any]) -> Any:
    """Return a surface for trimesh, with one texture coordinate per vertex, v pointing up."""
    import trimesh
    from PIL import Image

    visual: Any = trimesh.visual
    key = id(surface.texture)
    if key not in materials:
        materials[key] = visual.material.PBRMaterial(
            baseColorTexture=Image.fromarray(surface.texture),
            metallicFactor=0.0,
            roughnessFactor=1.0,
        )
    rows = np.concatenate(
        [surface.vertices[surface.faces], surface.uvs.astype(np.float64)], axis=2
    ).reshape(-1, 5)
    distinct, index = np.unique(rows, axis=0, return_inverse=True)
    uv = distinct[:, 3:] * (1, -1) + (0, 1)
    return trimesh.Trimesh(
        vertices=distinct[:, :3] @ Z_UP[:3, :3],
        faces=index.reshape(-1, 3),
        visual=visual.TextureVisuals(uv=uv, material=materials[key]),
        process=False,
    )
