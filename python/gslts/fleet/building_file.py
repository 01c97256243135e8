"""Files of buildings: rooms with their maps, and doors. People write them by hand, too."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from pathlib import Path, PurePosixPath
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    ValidationError,
    field_validator,
    model_validator,
)

from gslts.datasets.dataset import rigid
from gslts.fleet.url import is_url, require_url
from gslts.io.atomic_files import write_atomic
from gslts.io.bounded_files import read_bounded
from gslts.io.messages import first_problem
from gslts.store.causes import Motion, Point
from gslts.types import Floats

MAX_FILE_BYTES = 4 << 20
"""Maximum size of a file: bounds the memory for a hostile one. A room with a measured transform and
three doors takes 1 kB."""
MAX_TILT_RAD = math.radians(5)
"""Maximum tilt of a map in its building. Both have z up; a robot that measures the transform errs
by less than a degree, and a swapped axis by 90."""

RoomName = Annotated[str, Field(pattern=r"^[\w.@-]+( [\w.@-]+)*$", max_length=64)]


class _Strict(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


class Room(_Strict):
    """A room and its map.

    Attributes:
        map: Path of the map, relative to the file of the building, or the URL of a shared map. A
            whole path only in a file on the disk.
        building_from_map: [4,4] rigid transform, m; None if the map is in the building frame.
    """

    map: Annotated[str, Field(pattern=r"^\P{C}+$", max_length=1024)]
    building_from_map: Motion | None = None

    @field_validator("building_from_map")
    @classmethod
    def _is_rigid_and_upright(cls, value: Motion | None) -> Motion | None:
        if value is not None:
            tilt_rad = math.acos(np.clip(rigid(np.array(value))[2, 2], -1, 1))
            if tilt_rad > MAX_TILT_RAD:
                raise ValueError(f"it tilts the map by {math.degrees(tilt_rad):.0f}°; z must be up")
        return value

    @property
    def pose(self) -> Floats:
        """[4,4] building_from_map, rigid, m."""
        transform = self.building_from_map
        return np.eye(4) if transform is None else rigid(np.array(transform))


class Door(_Strict):
    """A passage between two rooms.

    Attributes:
        rooms: Names of the rooms.
        position_m: Middle of the doorway on the floor, building frame, m.
    """

    rooms: tuple[RoomName, RoomName]
    position_m: Point

    def __str__(self) -> str:
        """Return the rooms and the position."""
        x, y, _ = self.position_m
        return f"door between {self.rooms[0]} and {self.rooms[1]} at ({x:.2f}, {y:.2f}) m"


class BuildingFile(_Strict):
    """Content of a file.

    Attributes:
        schema_version: Layout of the file.
        rooms: By name.
        doors: Between rooms.
    """

    schema_version: Literal[1] = 1
    rooms: dict[RoomName, Room]
    doors: tuple[Door, ...] = ()

    @model_validator(mode="after")
    def _doors_join_rooms(self) -> Self:
        for number, door in enumerate(self.doors):
            unknown = [room for room in door.rooms if room not in self.rooms]
            if unknown:
                known = ", ".join(self.rooms) or "none"
                raise ValueError(f"doors.{number}: there is no room {unknown[0]}; rooms: {known}")
            if door.rooms[0] == door.rooms[1]:
                raise ValueError(f"doors.{number}: both sides are {door.rooms[0]}")
        return self


def read_building_file(location: str) -> BuildingFile:
    """Read and check a file.

    Args:
        location: Path or URL.

    Returns:
        The content.

    Raises:
        OSError: The file cannot be read.
        ValueError: It is too large, no JSON, or not a building.
    """
    content = _read(location)
    try:
        json.loads(content, object_pairs_hook=_require_distinct)
        building = BuildingFile.model_validate_json(content)
        for name, room in building.rooms.items():
            locate_map(name, room, location)
    except ValidationError as error:
        raise ValueError(f"{location}: {first_problem(error)}") from None
    except (ValueError, RecursionError) as error:
        raise ValueError(f"{location}: {error}") from None
    return building


def write_building_file(building: BuildingFile, path: Path) -> None:
    """Write a file atomically.

    Args:
        building: Content.
        path: Of the file.

    Raises:
        OSError: The file cannot be written; an old one is unchanged.
    """
    write_atomic(path, (building.model_dump_json(indent=1, exclude_none=True) + "\n").encode())


def locate_map(name: str, room: Room, location: str) -> str:
    """Return the path or the URL of the map of a room.

    Args:
        name: Of the room, for messages.
        room: Of the file.
        location: Path or URL of the file.

    Raises:
        ValueError: The map is outside of the folder of the file, and named neither by its whole
            path nor by a URL; or a file behind a URL has a whole path.
    """
    path = PurePosixPath(room.map)
    try:
        if "://" in room.map:
            return require_url(room.map)
        if path.is_absolute() and is_url(location):
            raise ValueError(f"{room.map} is a path of one machine; push the map, and give its URL")
        if ".." in path.parts:
            raise ValueError(
                f"{room.map} is outside of the folder of this file; give the whole path or a URL"
            )
    except ValueError as error:
        raise ValueError(f"rooms.{name}.map: {error}") from None
    if is_url(location):
        return f"{location.rpartition('/')[0]}/{path}"
    return str(Path(location).parent / path)


def _read(location: str) -> bytes:
    if is_url(location):
        from gslts.fleet.remote_file import read_remote_file

        return read_remote_file(location, MAX_FILE_BYTES)
    return read_bounded(Path(location), MAX_FILE_BYTES)


def _require_distinct(pairs: Sequence[tuple[str, Any]]) -> dict[str, Any]:
    """Return an object of JSON, which must not have a name twice."""
    result = dict(pairs)
    if len(result) < len(pairs):
        names = [name for name, _ in pairs]
        repeated = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"{repeated[:64]} occurs twice")
    return result
