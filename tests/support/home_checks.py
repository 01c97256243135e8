"""Checks of homes, importable by worker processes."""

import hashlib

import numpy as np

from gslts_sim import make_home
from gslts_sim.home import Home
from gslts_sim.physics import problems
from gslts_sim.walkable import walkable_floor

DETAIL = 0.06
"""Scale of the texture resolution; the checks do not depend on it."""


def complaints(room_type: str, seed: int) -> list[str]:
    """Return the problems of a home, in words."""
    home = make_home(room_type, seed, detail=DETAIL)
    found = problems(home) + wrong_ids(home) + wrong_meshes(home)
    movable = sum(obj.movable for obj in home.objects)
    if movable < 10:
        found.append(f"only {movable} movable objects")
    share = walkable_floor(home, home.rooms[0]).reached_fraction
    if share < 0.6:
        found.append(f"the robot reaches only {share:.2f} of the free floor")
    return [f"{home.name}: {complaint}" for complaint in found]


def wrong_ids(home: Home) -> list[str]:
    """Return ids other than `Type|number`, and parents that are no receptacles."""
    found = []
    counts: dict[str, int] = {}
    for obj in home.objects:
        counts[obj.type] = counts.get(obj.type, 0) + 1
        if obj.id != f"{obj.type}|{counts[obj.type]}":
            found.append(f"{obj.id} is number {counts[obj.type]} of {obj.type}")
        if obj.movable and not home[obj.parent].receptacle:
            found.append(f"{obj.id} stands on {obj.parent}, no receptacle")
    return found


def wrong_meshes(home: Home) -> list[str]:
    """Return surfaces that face inward, and boxes that leave parts out."""
    found = []
    for obj in home.objects:
        found += [
            f"{obj.id}: surface {k} is inside out"
            for k, surface in enumerate(obj.surfaces)
            if signed_volume(surface.vertices, surface.faces) <= 0
        ]
        vertices = np.concatenate([surface.vertices for surface in obj.surfaces])
        boxes = np.stack([obj.boxes[:, 0].min(axis=0), obj.boxes[:, 1].max(axis=0)])
        if abs(vertices[:, 2].min()) > 1e-6 or abs(boxes[0, 2]) > 1e-6:
            found.append(f"{obj.id}: its origin is not in its bottom")
        if (vertices < boxes[0] - 0.09).any() or (vertices > boxes[1] + 0.09).any():
            found.append(f"{obj.id}: its boxes leave out a part")
    return found


def signed_volume(vertices: np.ndarray, faces: np.ndarray) -> float:
    corners = (vertices - vertices.mean(axis=0))[faces]
    return float(np.einsum("fi,fi->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6)


def digest(home: Home) -> str:
    """Compute a hash of all data of a home."""
    result = hashlib.sha256(f"{home.name} {home.ambient.tolist()}".encode())
    for obj in home.objects:
        result.update(f"{obj.id} {obj.movable} {obj.receptacle} {obj.parent}".encode())
        for array in (obj.boxes, obj.world_from_object):
            result.update(array.tobytes())
        for surface in obj.surfaces:
            for part in (surface.vertices, surface.faces, surface.uvs, surface.texture):
                result.update(np.ascontiguousarray(part).tobytes())
    for light in home.all_lights:
        for edge in (light.center, light.edge_u, light.edge_v, light.radiance):
            result.update(edge.tobytes())
    return result.hexdigest()
