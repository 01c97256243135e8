"""Objects from typed meshes: their frames, boxes, roles and parents."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np

from gslts.types import Floats
from gslts_sim.gltf.boxes import filling_boxes
from gslts_sim.home import Home, HomeObject
from gslts_sim.mesh import Surface
from gslts_sim.physics import SUPPORT_M, support_below

BUILDING = frozenset({"Floor", "Ceiling", "Wall", "Window", "Door", "Doorway", "Room", "Stairs"})
"""Types of the building, which have no parent."""
FIXED = BUILDING | {
    *("Backsplash", "CeilingLamp", "Clock", "Curtains", "Faucet", "LightSwitch", "Mirror"),
    *("Outlet", "Painting", "Picture", "Radiator", "Shelf", "Sink", "StoveBurner", "Switch"),
}
"""Types that are never movable, however small."""
RECEPTACLES = frozenset(
    {
        *("ArmChair", "Bed", "Bench", "Bowl", "Box", "Cabinet", "Chair", "CoffeeTable"),
        *("CounterTop", "Desk", "DiningTable", "Dresser", "Floor", "Plate", "Rug", "Shelf"),
        *("ShelvingUnit", "SideTable", "Sink", "Sofa", "Stool", "StoveBurner", "TVStand", "Tray"),
    }
)
"""Types that carry objects, however small."""
MAX_MOVABLE_EDGE_M, MAX_MOVABLE_VOLUME_M3 = 0.6, 0.05
"""Maximum longest side, m, and volume of the bounding box, m^3, of movable objects."""
MIN_RECEPTACLE_AREA_M2 = 0.04
"""Minimum area of a level top that carries objects, m^2: a stack of books has less, a stool
more."""
UPRIGHT = 1e-4
"""Maximum sine of the tilt of an axis of a node that counts as vertical."""


def type_of(name: str) -> str:
    """Return the type in a node's name: the part before `|`, without the number of Blender.

    What ends in `Floor`, such as `ShopFloor`, is a floor.

    Args:
        name: Such as `Mug.001|2`.
    """
    kind = re.sub(r"\.\d{3,}$", "", name).split("|")[0] or name
    return "Floor" if kind.endswith("Floor") else kind


def place_object(
    object_id: str, kind: str, world_from_node: Floats, surfaces: list[Surface]
) -> HomeObject:
    """Make an object with its own frame and boxes; its type and shape decide about its role.

    Args:
        object_id: Its id.
        kind: Its type.
        world_from_node: [4,4] float64 of its node; the yaw is kept.
        surfaces: With vertices in the world, m.

    Raises:
        ValueError: All triangles are degenerate.
    """
    turn = _turn(world_from_node[:3, :3])
    turned = [surface.vertices @ turn for surface in surfaces]
    every = np.concatenate(turned)
    low, high = every.min(axis=0), every.max(axis=0)
    # Rounded to the micrometre, as in `make_home`: the last bits depend on the machine.
    origin = np.round([(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2]], 6)
    surfaces = [
        replace(surface, vertices=np.round(vertices - origin, 6) + 0.0)
        for surface, vertices in zip(surfaces, turned, strict=True)
    ]
    corners = np.concatenate([surface.vertices[surface.faces] for surface in surfaces])
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    if not normals.any():
        raise ValueError("its mesh has no triangles, only degenerate ones")
    boxes = filling_boxes(corners)
    world_from_object = np.eye(4)
    world_from_object[:3, :3], world_from_object[:3, 3] = turn, turn @ origin
    size = high - low
    small = bool(size.max() < MAX_MOVABLE_EDGE_M and size.prod() < MAX_MOVABLE_VOLUME_M3)
    furniture = not small and kind not in FIXED
    return HomeObject(
        id=object_id,
        type=kind,
        surfaces=tuple(surfaces),
        boxes=boxes,
        world_from_object=world_from_object,
        movable=small and kind not in FIXED,
        receptacle=kind in RECEPTACLES or (furniture and _has_level_top(corners)),
    )


def _turn(linear: Floats) -> Floats:
    """Return the yaw rotation [3,3] of a node with a vertical axis; else the identity."""
    axes = linear / np.maximum(np.linalg.norm(linear, axis=0), 1e-12)
    upright = np.abs(np.abs(axes[2]) - 1) < UPRIGHT**2
    level = np.abs(axes[2]) < UPRIGHT
    if upright.sum() != 1 or level.sum() != 2:
        return np.eye(3)
    cosine, sine = np.round(axes[:2, int(np.argmax(level))], 9) + 0.0
    length = np.hypot(cosine, sine)
    cosine, sine = cosine / length, sine / length
    return np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])


def _has_level_top(corners: Floats) -> bool:
    """Return whether the level, upward faces among [F,3,3] at one height have a large area."""
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    level = (np.ptp(corners[:, :, 2], axis=1) < SUPPORT_M) & (normals[:, 2] > 0)
    heights = np.round(corners[level, :, 2].mean(axis=1) / SUPPORT_M).astype(np.int64)
    _, group = np.unique(heights, return_inverse=True)
    areas = np.bincount(group, normals[level, 2] / 2, 1)
    return bool(areas.max() >= MIN_RECEPTACLE_AREA_M2)


def with_parents(home: Home) -> Home:
    """Set the parents of the objects of a home to the objects that they stand on.

    Args:
        home: Its parents are ignored.

    Returns:
        The home with parents.
    """
    bounds = np.stack([obj.box_in_world for obj in home.objects])
    parents: dict[str, str | None] = {}
    for obj, box in zip(home.objects, bounds, strict=True):
        if obj.type in BUILDING:
            continue
        near = (bounds[:, 0] <= box[1] + SUPPORT_M).all(axis=1)
        near &= (bounds[:, 1] >= box[0] - SUPPORT_M).all(axis=1)
        candidates = tuple(
            home.objects[k]
            for k in np.flatnonzero(near)
            if not _stands_above(home.objects[k].id, obj.id, parents)
        )
        parents[obj.id] = support_below(replace(home, objects=candidates), obj)
    return replace(home, objects=tuple(replace(o, parent=parents.get(o.id)) for o in home.objects))


def _stands_above(upper: str, lower: str, parents: dict[str, str | None]) -> bool:
    """Return whether an object is or stands, directly or not, on another; avoids cycles."""
    at: str | None = upper
    while at is not None and at != lower:
        at = parents.get(at)
    return at == lower
