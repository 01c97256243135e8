"""`load_home`: a home from any glTF file with one named node per object."""

from __future__ import annotations

import os
from collections import defaultdict
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gslts_sim.gltf.file import BadFileError, GltfFile, Tree
from gslts_sim.gltf.objects import place_object, type_of, with_parents
from gslts_sim.gltf.parts import read_nodes
from gslts_sim.home import AreaLight, Home, HomeObject, Room
from gslts_sim.mesh import Surface
from gslts_sim.procedural.homes import AMBIENT

ROOM_HEIGHT_M = 2.5
"""Of rooms without a ceiling."""
HOME_M = (0.5, 100.0)
"""Least and greatest length of all rooms of a home: others are in another unit than metres, or so
large that the grid of `walkable_floor` would have over four million cells."""
LIGHT_SIDE_M, LIGHT_RADIANCE, LIGHT_BELOW_M = 0.8, (11.0, 10.5, 9.8), 0.1
"""Of the lamp in each room: as in the rooms of `make_home`, but below what hangs at the ceiling."""
LIGHT_LEAST_M = 0.01
"""Side of the smallest lamp."""


def load_home(path: str | os.PathLike[str]) -> Home:
    """A home from a glTF 2.0 file, .glb or .gltf; the same for the same file, bit for bit.

    A mesh belongs to the nearest node, itself or above, with `extras.type` other than `Room`, else
    to the nearest with a name; such a node is an object, and a named node that owns no mesh is a
    group. `extras` may hold `type`, `movable`, `receptacle` and, on floors, `room`: its type.

    - Ids are the nodes' names; `|2`, `|3`, ... is added to a name that occurs again.
    - The type is `extras.type`, else the name before `|` without Blender's `.001`.
    - Without `extras.movable`, things of less than 0.6 m and 50 l are movable, unless their type
      belongs to a building. Without `extras.receptacle`, the type or a level top decides.
    - An object's own frame keeps the node's turn about the vertical; tilts, scales and mirrors are
      applied to its vertices. Its boxes are those of `filling_boxes`.
    - Each object of type `Floor` makes a room, as high as the ceiling over it or 2.5 m. Without a
      floor, everything is in one room. The world is shifted so that the lowest floor is at z = 0.
    - Each room gets one lamp below its ceiling, beside ambient light; lights in the file, skins,
      animations, opacity and all of a material but its base colour are left out. Textures repeat,
      whatever their sampler says. A surface with colours at its vertices and no texture gets one
      colour a triangle, one with both a texture tinted by their mean.

    Args:
        path: The file, which is not trusted and may have any suffix; a .gltf may refer to files in
            its folder or below.

    Raises:
        MemoryError: There is not enough memory for it.
        OSError: A file cannot be read.
        ValueError: It is damaged, too large, has no named nodes, needs what is not supported, or
            its rooms have the size of no home.
    """
    path = Path(path)
    try:
        return _home(GltfFile(path))
    except (BadFileError, OSError, MemoryError):
        raise
    except Exception as error:  # Whatever an untrusted file provokes below.
        line = " ".join(f"{type(error).__name__}: {error}".split())[:300]
        raise ValueError(f"load_home: {path}: it is damaged: {line}") from error


@dataclass(frozen=True, eq=False)
class _Found:
    """An object and, if it is a floor, the type of its room."""

    obj: HomeObject
    room: str


def _home(file: GltfFile) -> Home:
    nodes = {node.index: node for node in read_nodes(file)}
    owned: dict[int, list[Surface]] = defaultdict(list)
    for node in nodes.values():
        if node.surfaces:
            owned[_owner(file, node.index)] += node.surfaces
    if not owned:
        file.refuse("no node has a mesh")
    found: list[_Found] = []
    times: dict[str, int] = {}
    for index in nodes:  # In the order of the file.
        if index in owned:
            name, extras = str(_name(file, index)), _extras(file, index)
            kind = extras.get("type") or type_of(name)
            unique = _unique(name, times)
            try:
                obj = place_object(unique, kind, nodes[index].world_from_node, owned[index])
            except ValueError as error:
                file.refuse(f"{file.label(index)}: {error}")
            movable = bool(extras.get("movable", obj.movable))
            receptacle = bool(extras.get("receptacle", obj.receptacle))
            obj = replace(obj, movable=movable, receptacle=receptacle)
            found.append(_Found(obj, str(extras.get("room", "room"))))
    rooms = _rooms(found)
    corners = np.concatenate([room.box for room in rooms])
    size = np.ptp(corners, axis=0)
    # Rooms without a ceiling are as high as others, however small.
    if size[:2].max() < HOME_M[0] or size.max() > HOME_M[1]:
        sides = " x ".join(f"{side:.4g}" for side in size)
        least, most = HOME_M
        file.refuse(f"its rooms measure {sides} m; homes in metres have {least:g} to {most:g} m")
    shift = np.eye(4)
    shift[2, 3] = -min(float(room.box[0, 2]) for room in rooms)
    objects = [one.obj.place_at(shift @ one.obj.world_from_object, None) for one in found]
    rooms = [Room(room.type, room.box + shift[:3, 3]) for room in rooms]
    home = Home(
        name=file.path.stem,
        rooms=tuple(rooms),
        objects=tuple(objects),
        lights=tuple(_lamp(room) for room in rooms),
        ambient=np.array(AMBIENT),
    )
    return with_parents(home)


def _name(file: GltfFile, index: int) -> str | None:
    """A node's name, which is its type if it has one and no name; None if neither."""
    node = file.items("nodes")[index]
    name = node.get("name") or _extras(file, index).get("type")
    return None if name is None else str(name)


def _extras(file: GltfFile, index: int) -> Tree:
    extras = file.items("nodes")[index].get("extras")
    extras = extras if isinstance(extras, dict) else {}
    for key, kinds in (("type", str), ("room", str), ("movable", int), ("receptacle", int)):
        if key in extras and (not isinstance(extras[key], kinds) or extras[key] == ""):
            file.refuse(f"{file.label(index)}: extras.{key} is {extras[key]!r}")
    return extras


def _owner(file: GltfFile, index: int) -> int:
    """The node of the object that a node's mesh belongs to."""
    chain: list[int] = []
    above: int | None = index
    while above is not None:
        chain.append(above)
        above = file.parents[above]
    typed = [node for node in chain if _extras(file, node).get("type", "Room") != "Room"]
    named = [node for node in chain if _name(file, node)]
    if not typed and not named:
        file.refuse(f"{file.label(index)} has a mesh, but neither it nor a node above has a name")
    return (typed or named)[0]


def _unique(name: str, times: dict[str, int]) -> str:
    """The name, numbered if it was given before; counts in `times` how often each was."""
    unique = name
    while unique in times:
        times[name] += 1
        unique = f"{name}|{times[name]}"
    times[unique] = 1
    return unique


def _rooms(found: list[_Found]) -> list[Room]:
    bounds = np.stack([one.obj.box_in_world for one in found])
    ceilings = [one.obj.box_in_world for one in found if one.obj.type == "Ceiling"]
    rooms = []
    for one, box in zip(found, bounds, strict=True):
        if one.obj.type == "Floor":
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
            rooms.append(Room(one.room, np.stack([lower, upper])))
    if not rooms:
        whole = np.stack([bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)])
        rooms = [Room("room", whole)]
    return rooms


def _lamp(room: Room) -> AreaLight:
    """A light below the middle of a room's ceiling, no wider than half the room or 0.01 m."""
    size = room.box[1] - room.box[0]
    # A picture without depth is a room, too, and a light needs an area.
    side = float(np.clip(size[:2].min() / 2, LIGHT_LEAST_M, LIGHT_SIDE_M))
    center = room.box.mean(axis=0)
    center[2] = room.box[1, 2] - min(LIGHT_BELOW_M, float(size[2]) / 2)
    return AreaLight(
        center=center,
        edge_u=np.array([0.0, side, 0.0]),
        edge_v=np.array([side, 0.0, 0.0]),
        radiance=np.array(LIGHT_RADIANCE),
    )
