"""Reading of homes from any glTF file with one named node per object."""

from __future__ import annotations

import os
from collections import defaultdict
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gslts.io.gltf_file import BadFileError, Tree
from gslts_sim.gltf.file import HomeFile
from gslts_sim.gltf.objects import place_object, type_of, with_parents
from gslts_sim.gltf.parts import Node, read_nodes
from gslts_sim.home import AreaLight, Home, HomeObject, Room
from gslts_sim.mesh import Surface
from gslts_sim.procedural.homes import AMBIENT

ROOM_HEIGHT_M = 2.5
"""Height of rooms without a ceiling, m."""
HOME_SIZE_M = (0.5, 100.0)
"""Minimum and maximum extent of all rooms of a home, m: others are not in metres, or so large that
the grid of `walkable_floor` would have over four million cells."""
LAMP_SIDE_M, LAMP_RADIANCE, LAMP_BELOW_M = 0.8, (11.0, 10.5, 9.8), 0.1
"""Side, radiance and distance from the ceiling of the lamp in each room: as in `make_home`, but
below the objects at the ceiling."""
MIN_LAMP_SIDE_M = 0.01
"""Minimum side of a lamp, m: a light needs an area, even in a flat room."""


def load_home(path: str | os.PathLike[str]) -> Home:
    """Read a home from a glTF 2.0 file, .glb or .gltf; bit-identical for the same file.

    A mesh belongs to the nearest node, itself or above, with `extras.type` other than `Room`, else
    to the nearest with a name; such a node is an object, and a named node that owns no mesh is a
    group. `extras` may hold `type`, `movable`, `receptacle` and, on floors, `room`: its type.

    - Ids are the nodes' names; `|2`, `|3`, ... is added to a name that occurs again.
    - The type is `extras.type`, else the name, up to `|` and without Blender's `.001`; `Floor` if
      that is its end, as in `ShopFloor`.
    - Without `extras.movable`, objects of less than 0.6 m and 50 l are movable, unless their type
      belongs to a building. Without `extras.receptacle`, the type or a level top decides.
    - An object's own frame keeps the node's yaw; tilts, scales and mirrors are applied to its
      vertices. Its boxes are those of `filling_boxes`.
    - Each object of type `Floor` makes a room, as high as the ceiling over it or 2.5 m. Without a
      floor, everything is in one room. The world is shifted so that the lowest floor is at z = 0.
    - Each room gets one lamp below its ceiling, beside ambient light. Lights in the file, skins,
      animations, opacity and all of a material but its base colour are ignored; textures always
      repeat. A surface with vertex colours and no texture gets one colour per triangle; one with
      both, a texture multiplied by their mean.

    Args:
        path: The file, which is untrusted and may have any suffix; a .gltf may refer to files in
            its folder or below.

    Raises:
        ImportError: trimesh is missing.
        MemoryError: There is not enough memory.
        OSError: A file cannot be read.
        ValueError: It is damaged, too large, has no named nodes, is not supported, or the size of
            its rooms is not that of a home.
    """
    path = Path(path)
    try:
        return _home(HomeFile(path))
    except (BadFileError, ImportError, OSError, MemoryError):
        raise
    except Exception as error:  # An untrusted file may cause any.
        line = " ".join(f"{type(error).__name__}: {error}".split())[:300]
        raise ValueError(f"load_home: {path}: it is damaged: {line}") from error


@dataclass(frozen=True, eq=False)
class _LoadedObject:
    """An object and, if it is a floor, the type of its room."""

    obj: HomeObject
    room: str


def _home(file: HomeFile) -> Home:
    nodes = {node.index: node for node in read_nodes(file)}
    owned: dict[int, list[Surface]] = defaultdict(list)
    for node in nodes.values():
        if node.surfaces:
            owned[_owner(file, node.index)] += node.surfaces
    if not owned:
        file.reject("no node has a mesh")
    counts: dict[str, int] = {}
    # In the order of the file.
    loaded = [_load_object(file, nodes[k], owned[k], counts) for k in nodes if k in owned]
    rooms = _rooms(loaded)
    _require_size(file, rooms)
    shift = np.eye(4)
    shift[2, 3] = -min(float(room.box[0, 2]) for room in rooms)
    objects = [item.obj.place_at(shift @ item.obj.world_from_object, None) for item in loaded]
    rooms = [Room(room.type, room.box + shift[:3, 3]) for room in rooms]
    home = Home(
        name=file.path.stem,
        rooms=tuple(rooms),
        objects=tuple(objects),
        lights=tuple(_lamp(room) for room in rooms),
        ambient=np.array(AMBIENT),
    )
    return with_parents(home)


def _load_object(
    file: HomeFile, node: Node, surfaces: list[Surface], counts: dict[str, int]
) -> _LoadedObject:
    """Return the object of a node; counts names in `counts`."""
    name, extras = str(_name(file, node.index)), _extras(file, node.index)
    object_id = _unique(name, counts)
    try:
        obj = place_object(
            object_id, type_of(extras.get("type") or name), node.world_from_node, surfaces
        )
    except ValueError as error:
        file.reject(f"{file.label(node.index)}: {error}")
    movable = bool(extras.get("movable", obj.movable))
    receptacle = bool(extras.get("receptacle", obj.receptacle))
    obj = replace(obj, movable=movable, receptacle=receptacle)
    return _LoadedObject(obj, str(extras.get("room", "room")))


def _require_size(file: HomeFile, rooms: list[Room]) -> None:
    """Reject a home whose rooms together are too small or too large."""
    size = np.ptp(np.concatenate([room.box for room in rooms]), axis=0)
    min_m, max_m = HOME_SIZE_M
    # The height does not tell: rooms without a ceiling have ROOM_HEIGHT_M, however small.
    if size[:2].max() < min_m or size.max() > max_m:
        sides = " x ".join(f"{side:.4g}" for side in size)
        file.reject(f"its rooms measure {sides} m; homes in metres have {min_m:g} to {max_m:g} m")


def _name(file: HomeFile, index: int) -> str | None:
    """Return a node's name, else its type; None if it has neither."""
    node = file.items("nodes")[index]
    name = node.get("name") or _extras(file, index).get("type")
    return None if name is None else str(name)


def _extras(file: HomeFile, index: int) -> Tree:
    extras = file.items("nodes")[index].get("extras")
    extras = extras if isinstance(extras, dict) else {}
    for key, kinds in (("type", str), ("room", str), ("movable", int), ("receptacle", int)):
        if key in extras and (not isinstance(extras[key], kinds) or extras[key] == ""):
            file.reject(f"{file.label(index)}: extras.{key} is {extras[key]!r}")
    return extras


def _owner(file: HomeFile, index: int) -> int:
    """Return the node of the object that a node's mesh belongs to."""
    chain: list[int] = []
    above: int | None = index
    while above is not None:
        chain.append(above)
        above = file.parents[above]
    typed = [node for node in chain if _extras(file, node).get("type", "Room") != "Room"]
    named = [node for node in chain if _name(file, node)]
    if not typed and not named:
        file.reject(f"{file.label(index)} has a mesh, but neither it nor a node above has a name")
    return (typed or named)[0]


def _unique(name: str, counts: dict[str, int]) -> str:
    """Return the name, numbered if it was used before; updates the counts."""
    unique = name
    while unique in counts:
        counts[name] += 1
        unique = f"{name}|{counts[name]}"
    counts[unique] = 1
    return unique


def _rooms(loaded: list[_LoadedObject]) -> list[Room]:
    """Return a room on each floor; one around all objects if there is no floor."""
    bounds = np.stack([item.obj.box_in_world for item in loaded])
    ceilings = [item.obj.box_in_world for item in loaded if item.obj.type == "Ceiling"]
    rooms = []
    for item, box in zip(loaded, bounds, strict=True):
        if item.obj.type == "Floor":
            lower, upper = box[0].copy(), box[1].copy()
            lower[2] = box[1, 2]
            middle = (lower + upper)[:2] / 2
            over = [
                float(other[0, 2])
                for other in ceilings
                if other[0, 2] > lower[2]
                and (other[0, :2] <= middle).all()
                and (middle <= other[1, :2]).all()
            ]
            upper[2] = min(over, default=lower[2] + ROOM_HEIGHT_M)
            rooms.append(Room(item.room, np.stack([lower, upper])))
    if not rooms:
        whole = np.stack([bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)])
        rooms = [Room("room", whole)]
    return rooms


def _lamp(room: Room) -> AreaLight:
    """Return a light below the middle of a room's ceiling, at most half as wide as the room."""
    size = room.box[1] - room.box[0]
    side = float(np.clip(size[:2].min() / 2, MIN_LAMP_SIDE_M, LAMP_SIDE_M))
    center = room.box.mean(axis=0)
    center[2] = room.box[1, 2] - min(LAMP_BELOW_M, float(size[2]) / 2)
    return AreaLight(
        center=center,
        edge_u=np.array([0.0, side, 0.0]),
        edge_v=np.array([side, 0.0, 0.0]),
        radiance=np.array(LAMP_RADIANCE),
    )
