"""Edits of the file of a building: a room, a door."""

from __future__ import annotations

import os
from pathlib import Path

from pydantic import ValidationError

from gslts.core.robot_body import RobotBody
from gslts.datasets.dataset import read_numbers
from gslts.fleet.building import Building
from gslts.fleet.building_file import BuildingFile, Door, Room, locate_map, write_building_file
from gslts.io.messages import first_problem
from gslts.store.causes import Motion, Point
from gslts.store.manifest import require_map_folder


def add_room(file: str | Path, name: str, map_path: str, transform: Path | None = None) -> Building:
    """Add a room to the file of a building; make the file if there is none.

    Args:
        file: Path of the file.
        name: Of the room.
        map_path: Folder of the map, or the URL of a shared map.
        transform: Text file of building_from_map, 4 x 4 numbers, rigid, m; None if the map is in
            the building frame.

    Returns:
        The building.

    Raises:
        OSError: A file cannot be read or written; the file of the building is as before.
        ValueError: The room is there already, its name or the transform is invalid, or the map is
            none; the file is as before.
    """
    path, old = Path(file), _read(file, may_be_new=True)
    if name in old.rooms:
        raise ValueError(f"{path}: there is a room {name} already; edit the file to change it")
    if "://" not in map_path and not Path(map_path).is_absolute():
        map_path = os.path.relpath(map_path, path.parent)
    pose = None if transform is None else _read_transform(transform)
    try:
        room = Room(map=map_path, building_from_map=pose)
    except ValidationError as error:
        raise ValueError(f"{transform or map_path}: {first_problem(error)}") from None
    try:
        content = BuildingFile(rooms={**old.rooms, name: room}, doors=old.doors)
        locate_map(name, room, str(path))
    except ValidationError as error:
        raise ValueError(f"{path}: {first_problem(error)}") from None
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from None
    building = Building(str(path), content)
    require_map_folder(building.map_path(name))
    write_building_file(content, path)
    return building


def add_door(file: str | Path, rooms: tuple[str, str], position_m: Point) -> Building:
    """Add a door to the file of a building.

    Args:
        file: Path of the file.
        rooms: Names of the rooms on its sides.
        position_m: Middle of the doorway on the floor, building frame, m.

    Returns:
        The building.

    Raises:
        OSError: A file cannot be read or written; the file of the building is as before.
        ValueError: A room is unknown, or its map has no free floor there; the file is as before.
    """
    from gslts.fleet.building_route import RoomFloor

    path, old = Path(file), _read(file)
    try:
        door = Door(rooms=rooms, position_m=position_m)
        content = BuildingFile(rooms=dict(old.rooms), doors=(*old.doors, door))
    except ValidationError as error:
        raise ValueError(f"{path}: {first_problem(error)}") from None
    for room in rooms:
        problem = RoomFloor(old, room, RobotBody()).problem_of(door)
        if problem:
            raise ValueError(f"{path}: {problem}")
    write_building_file(content, path)
    return Building(str(path), content)


def _read(file: str | Path, *, may_be_new: bool = False) -> Building:
    if "://" in str(file):
        raise ValueError(f"{file}: edit a file on this disk, then copy it to its bucket")
    if may_be_new and not Path(file).exists():
        return Building(str(file), BuildingFile(rooms={}))
    return Building.read(file)


def _read_transform(path: Path) -> Motion:
    first, second, third, last = (tuple(row) for row in read_numbers(path, (4, 4)).tolist())
    return first, second, third, last
