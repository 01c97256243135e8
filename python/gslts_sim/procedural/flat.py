"""A flat: rooms with open doors on both sides of a hall."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gslts.types import Floats
from gslts_sim.home import AreaLight, Home, HomeObject, Room, pose, yaw_of
from gslts_sim.procedural.catalog import building
from gslts_sim.procedural.catalog.building import DOOR_M, THICKNESS_M, Opening
from gslts_sim.procedural.model import Kit, Model
from gslts_sim.procedural.scene import Scene
from gslts_sim.procedural.shapes import box

HALL_WIDTH_M = 1.5
"""Width of the hall; the robot turns in it and sees both of its walls."""
WALL_M = 2 * THICKNESS_M
"""Distance between two rooms: each has walls of its own."""
NORTH, SOUTH = 0, 2
"""Numbers of the walls of the hall that have doors."""


def join_rooms(name: str, rooms: list[Home], kit: Kit, ambient: Floats) -> Home:
    """Join rooms to a flat: all but the last stand in a row north of a hall, the last one south.

    Args:
        name: For people.
        rooms: Homes of one room with one door each.
        kit: Materials, style and random stream of the hall.
        ambient: (3,) float64, linear RGB.
    """
    placed: list[Home] = []
    doors: list[tuple[int, float]] = []  # Wall of the hall, and position along x, m.
    west = 0.0
    for number, room in enumerate(rooms):
        north = number < len(rooms) - 1
        corner = np.array([west if north else 0.0, HALL_WIDTH_M + WALL_M if north else -WALL_M])
        home, door_x = _turn_to_hall(room, number, corner, north=north)
        placed.append(home)
        doors.append((NORTH if north else SOUTH, door_x))
        west += np.ptp(home.rooms[0].box[:, 0]) + WALL_M if north else 0.0
    east = max(float(home.rooms[0].box[1, 0]) for home in placed)
    height = min(float(home.rooms[0].box[1, 2]) for home in placed)
    hall = _hall(kit, (east, HALL_WIDTH_M, height), doors, ambient)
    homes = [hall, *placed]
    return Home(
        name,
        tuple(room for home in homes for room in home.rooms),
        tuple(obj for home in homes for obj in home.objects),
        tuple(light for home in homes for light in home.lights),
        ambient,
    )


def open_door(home: Home, other: Home, kit: Kit) -> Home:
    """Open the door of a room to another room behind it.

    Args:
        home: Of one room with one door; all of it but the door stays as it is.
        other: Such a room, too. It is turned and moved, and its objects get new ids.
        kit: Materials of the floor in the doorway.

    Returns:
        A home of two rooms.
    """
    door, back = (_door_of(each) for each in (home, other))
    yaw = yaw_of(door)
    outward = np.array([-np.sin(yaw), np.cos(yaw), 0.0])
    at = door.world_from_object[:3, 3]
    turn = pose(0, 0, 0, yaw + np.pi - yaw_of(back))
    turn[:3, 3] = np.round(at + WALL_M * outward - (turn @ back.world_from_object)[:3, 3], 6)
    behind = _move_room(other, back, turn, 1)
    scene = Scene(kit, "hall", (1.0, 1.0, 1.0))
    x, y, _ = at + WALL_M / 2 * outward
    sill = scene.add(scene.build(_sill), pose(x, y, -THICKNESS_M, yaw), None)
    return Home(
        home.name,
        (*home.rooms, *behind.rooms),
        (*(o for o in home.objects if o is not door), replace(sill, id="Sill|1"), *behind.objects),
        (*home.lights, *behind.lights),
        home.ambient,
    )


def _hall(
    kit: Kit, size: tuple[float, float, float], doors: list[tuple[int, float]], ambient: Floats
) -> Home:
    """Build the hall: its floor also lies in the doorways."""
    scene = Scene(kit, "hall", size)
    openings: dict[int, list[Opening]] = {}
    for wall, x in doors:
        along = x if wall == NORTH else size[0] - x
        half = DOOR_M[0] / 2
        openings.setdefault(wall, []).append(Opening(along - half, along + half, 0.0, DOOR_M[1]))
    scene.shell(openings, accent=-1)
    for wall, x in doors:
        y = size[1] + WALL_M / 2 if wall == NORTH else -WALL_M / 2
        scene.add(scene.build(_sill), pose(x, y, -THICKNESS_M, 0), None)
    lamps = max(1, round(size[0] / 3))
    for lamp in range(lamps):
        warm = 6.0 * np.array([1.0, 0.94, 0.84])
        scene.ceiling_light((lamp + 0.5) * size[0] / lamps, size[1] / 2, 0.5, warm)
    return scene.home("hall", ambient)


def _sill(kit: Kit) -> Model:
    """Build the floor of a doorway."""
    model = Model("Floor", receptacle=True)
    floor = building.floor_material(kit, "hall")
    model.add(box(DOOR_M[0], WALL_M, THICKNESS_M), floor)
    return model


def _turn_to_hall(room: Home, number: int, corner: Floats, *, north: bool) -> tuple[Home, float]:
    """Turn a room so that its door faces the hall, open the door, and move it to a corner.

    Args:
        room: Of one room.
        number: Becomes a part of the ids of its objects.
        corner: (2,) west end of its side at the hall, m.
        north: It stands north of the hall.

    Returns:
        The room, and the position of its door along x, m.
    """
    door = _door_of(room)
    turn = pose(0, 0, 0, (np.pi if north else 0.0) - yaw_of(door))
    low, high = _turned_box(room.rooms[0].box, turn)
    shift = corner - np.array([low[0], low[1] if north else high[1]])
    turn[:2, 3] = np.round(shift, 6)
    door_x = float((turn @ door.world_from_object)[0, 3])
    return _move_room(room, door, turn, number), door_x


def _door_of(room: Home) -> HomeObject:
    return next(obj for obj in room.objects if obj.type == "Door")


def _move_room(room: Home, door: HomeObject, turn: Floats, number: int) -> Home:
    """Return a room after a motion [4,4], with an open door and `number` in the ids of objects."""
    objects = [_move(obj, turn, number) for obj in room.objects if obj is not door]
    lights = [_move_light(light, turn, number) for light in room.lights]
    moved = Room(room.rooms[0].type, _turned_box(room.rooms[0].box, turn))
    return Home(room.name, (moved,), tuple(objects), tuple(lights), room.ambient)


def _turned_box(corners: Floats, turn: Floats) -> Floats:
    """Return the box [2,3] after a motion [4,4] by quarter turns."""
    ends = corners @ turn[:3, :3].T + turn[:3, 3]
    return np.round(np.stack([ends.min(axis=0), ends.max(axis=0)]), 6)


def _move(obj: HomeObject, motion: Floats, number: int) -> HomeObject:
    """Return an object of room `number` after a motion [4,4]."""
    x, y, z = (motion @ obj.world_from_object)[:3, 3]
    yaw = np.arctan2(motion[1, 0], motion[0, 0]) + yaw_of(obj)
    parent = None if obj.parent is None else f"{obj.parent}|{number}"
    return replace(obj.place_at(pose(x, y, z, yaw), parent), id=f"{obj.id}|{number}")


def _move_light(light: AreaLight, motion: Floats, number: int) -> AreaLight:
    owner = None if light.owner is None else f"{light.owner}|{number}"
    return replace(
        light,
        center=motion[:3, :3] @ light.center + motion[:3, 3],
        edge_u=motion[:3, :3] @ light.edge_u,
        edge_v=motion[:3, :3] @ light.edge_v,
        owner=owner,
    )
