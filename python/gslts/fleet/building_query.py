"""Text queries on all maps of a building."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gslts.core.se3 import transform
from gslts.navigation.viewpoints import Target
from gslts.semantics.files import read_semantics
from gslts.semantics.queries import Instance, SemanticQueries
from gslts.semantics.registry import open_text_source
from gslts.semantics.source import SemanticSource
from gslts.store.causes import SemanticsCause
from gslts.store.map_folder import read_map
from gslts.types import Floats

if TYPE_CHECKING:
    from gslts.fleet.building import Building


@dataclass(frozen=True, eq=False)
class FoundObject:
    """An object in a room that matches a query.

    Attributes:
        room: Name of the room whose map shows it best.
        instance: The object, in the building frame.
        target: Points on it, in the frame of the map of the room.
    """

    room: str
    instance: Instance
    target: Target


@dataclass(frozen=True, eq=False)
class BuildingAnswer:
    """Answer of a building to a query.

    Attributes:
        text: The query.
        found: The objects, the best score first.
        without_words: Rooms whose maps have no semantic features.
        problems: Reasons why maps cannot be read, by room.
    """

    text: str
    found: tuple[FoundObject, ...]
    without_words: tuple[str, ...]
    problems: dict[str, str]


def query_building(
    building: Building, text: str, text_model: Path | None = None, threads: int = 0
) -> BuildingAnswer:
    """See `Building.query`."""
    if not text.strip():
        raise ValueError("WORDS: expected the name of an object, got nothing")
    sources: dict[tuple[object, ...], SemanticSource] = {}

    def open_source(cause: SemanticsCause) -> SemanticSource:
        key = (cause.source, tuple(sorted(cause.models.items())), cause.names)
        if key not in sources:  # Loading CLIP takes seconds.
            sources[key] = open_text_source(cause, text_model, threads)
        return sources[key]

    def find(room: str) -> list[FoundObject] | None:
        path = building.map_path(room)
        semantics = read_semantics(path)
        if semantics is None:
            return None
        cause, codec = semantics
        gaussian_map = read_map(path)
        queries = SemanticQueries(gaussian_map, codec, open_source(cause))
        pose = building.rooms[room].pose
        return [
            FoundObject(
                room, _in_building(instance, pose), Target.of_instance(gaussian_map, instance)
            )
            for instance in queries.find(text)
        ]

    by_room, problems = building.for_each_room(find)
    without_words = tuple(room for room, found in by_room.items() if found is None)
    if len(without_words) == len(building.rooms):
        raise ValueError(
            f"{building.location}: no map has semantic features; gslts semantics adds them"
        )
    found = _drop_repeated([item for found in by_room.values() for item in found or ()])
    found.sort(key=lambda item: -item.instance.score)
    return BuildingAnswer(text, tuple(found), without_words, problems)


def _in_building(instance: Instance, building_from_map: Floats) -> Instance:
    """Transform the boxes of an instance."""
    if (building_from_map == np.eye(4)).all():
        return instance
    heights = np.repeat([instance.low[2], instance.high[2]], 4)[:, None]
    ends = transform(building_from_map, np.hstack([np.tile(instance.corners, (2, 1)), heights]))
    corners = (ends[:4, :2] + ends[4:, :2]) / 2
    return replace(instance, low=ends.min(axis=0), high=ends.max(axis=0), corners=corners)


def _drop_repeated(found: Sequence[FoundObject]) -> list[FoundObject]:
    """Drop objects within a larger view of an object in the map of another room."""

    def is_repeated(item: FoundObject) -> bool:
        own = item.instance
        return any(
            other.room != item.room
            and len(other.instance.rows) > len(own.rows)
            and (own.center >= other.instance.low).all()
            and (own.center <= other.instance.high).all()
            for other in found
        )

    return [item for item in found if not is_repeated(item)]
