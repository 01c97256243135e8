"""A building: rooms with maps of their own, and the doors between them."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Self, TypeVar

from gslts.fleet.building_file import (
    BuildingFile,
    Door,
    Room,
    locate_map,
    read_building_file,
)
from gslts.fleet.building_history import RoomHistory, read_room_history
from gslts.fleet.cache import cached_clone
from gslts.fleet.url import is_url
from gslts.io.messages import to_line

if TYPE_CHECKING:  # `show` needs neither semantics nor path planning.
    from gslts.core.robot_body import RobotBody
    from gslts.fleet.building_query import BuildingAnswer
    from gslts.fleet.building_route import Route
    from gslts.types import Floats

Read = TypeVar("Read")

DAY_S = 86400.0
"""Age up to which changes are listed, s."""


@dataclass(frozen=True)
class Building:
    """Rooms with their maps, and doors, from a file on the disk or behind a URL.

    Attributes:
        location: Path or URL of the file.
        content: Of the file.
    """

    location: str
    content: BuildingFile
    _paths: dict[str, Path] = field(default_factory=dict, repr=False, compare=False)

    @classmethod
    def read(cls, location: str | Path) -> Self:
        """Read the file of a building; its maps are read when they are needed.

        Args:
            location: Path or URL (s3://, gs://, az://, file://).

        Returns:
            The building.

        Raises:
            OSError: The file cannot be read.
            ValueError: The file is no building.
        """
        return cls(str(location), read_building_file(str(location)))

    @property
    def rooms(self) -> Mapping[str, Room]:
        """Rooms by name."""
        return self.content.rooms

    @property
    def doors(self) -> tuple[Door, ...]:
        """Doors between rooms."""
        return self.content.doors

    def map_path(self, room: str) -> Path:
        """Return the folder of the map of a room; of a shared map, that of a clone.

        Args:
            room: Name of the room.

        Returns:
            The folder. A clone has the newest version of the time of the first call.

        Raises:
            OSError: A shared map cannot be read.
            ValueError: There is no such room, or a shared map is damaged.
        """
        if room not in self.rooms:
            known = ", ".join(self.rooms) or "none"
            raise ValueError(f"{self.location}: there is no room {room}; rooms: {known}")
        if room not in self._paths:
            source = locate_map(room, self.rooms[room], self.location)
            self._paths[room] = cached_clone(source) if is_url(source) else Path(source)
        return self._paths[room]

    def histories(
        self, since_s: float | None = None
    ) -> tuple[dict[str, RoomHistory], dict[str, str]]:
        """Read what happened in all rooms.

        Args:
            since_s: Time of the oldest change to list, s since 1970 (UTC); None means a day ago.

        Returns:
            Histories by room, and the reasons why other maps cannot be read.
        """
        start_s = time.time() - DAY_S if since_s is None else since_s
        return self.for_each_room(lambda room: read_room_history(self.map_path(room), start_s))

    def query(self, text: str, text_model: Path | None = None, threads: int = 0) -> BuildingAnswer:
        """Find the objects in all rooms that match a text.

        An object that the maps of two rooms show, through a door, is found once.

        Args:
            text: Such as "alarm clock".
            text_model: Folder of a text model; see `open_text_source`.
            threads: For CLIP; 0 uses the default of torch.

        Returns:
            The objects, and the rooms that gave no answer.

        Raises:
            ImportError: transformers is missing.
            ValueError: The text is empty, or no map has semantic features.
        """
        from gslts.fleet.building_query import query_building

        return query_building(self, text, text_model, threads)

    def plan(
        self,
        answer: BuildingAnswer,
        start: Floats,
        room: str | None = None,
        body: RobotBody | None = None,
    ) -> Route:
        """Plan the shortest route to an object that a query found, through doors.

        Args:
            answer: Of `query`.
            start: (3,) position of the camera of a robot in the building frame, m; with a room,
                (2,) x and y.
            room: Name of the room of the start; None means each room whose map has floor there.
            body: Size of the robot; None for the default.

        Returns:
            The route, or the reason why there is none.

        Raises:
            ValueError: There is no such room.
        """
        from gslts.fleet.building_route import RoutePlanner

        planner = RoutePlanner(self, answer, body)
        return planner.plan(start, planner.rooms_at(start) if room is None else [room])

    def for_each_room(self, read: Callable[[str], Read]) -> tuple[dict[str, Read], dict[str, str]]:
        """Read something of each room; a map that cannot be read does not stop the others.

        Args:
            read: Given the name of a room.

        Returns:
            Results by room, and the reasons of failures by room.
        """
        results: dict[str, Read] = {}
        problems: dict[str, str] = {}
        for room in self.rooms:
            try:
                results[room] = read(room)
            except (OSError, ValueError) as error:
                problems[room] = to_line(str(error))
        return results, problems
