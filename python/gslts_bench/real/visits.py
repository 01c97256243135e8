"""A real room: recorded visits, and the map of the first one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from gslts.datasets import Frame, open_dataset
from gslts.mapping.config import MappingConfig
from gslts.mapping.engine import make_map
from gslts.mapping.report.summary import write_result
from gslts_bench.cache import cached_folder, code_digest, native_digest
from gslts_bench.real.boxes import MarkedObject, MarkedRoom, marked_rooms
from gslts_bench.relocalization.room import content_digest


@dataclass(frozen=True, eq=False)
class RealRoom:
    """Recorded visits of one room.

    Attributes:
        path: Folder with a folder per visit.
        marked: Boxes of the changed objects.
        mapping: Settings of the mapping.
        work: Folder where everything made is kept.
        mapped_of: JSON values that decide the map.
    """

    path: Path
    marked: MarkedRoom
    mapping: MappingConfig
    work: Path
    mapped_of: dict[str, Any] = field(init=False)

    def __post_init__(self) -> None:
        values = {
            "dataset": content_digest(self.reference),
            "mapping": self.mapping.model_dump(exclude={"threads"}),
            "code": {"python": code_digest(__name__), "native": native_digest()},
        }
        object.__setattr__(self, "mapped_of", values)

    @property
    def name(self) -> str:
        """Name of the room."""
        return self.marked.room

    @property
    def judged_of(self) -> dict[str, Any]:
        """JSON values that decide results besides the map: boxes and content of later visits.

        Raises:
            OSError: A visit cannot be read.
        """
        visits = {visit: content_digest(self.path / visit) for visit in self.marked.visits}
        return {"marked": self.marked.model_dump(mode="json"), "visits": visits}

    @property
    def reference(self) -> Path:
        """Data set that the map is made from."""
        return self.path / self.marked.reference

    def frames(self, visit: str) -> list[tuple[Frame, Sequence[MarkedObject]]]:
        """Return the frames of a visit, each with the differences marked in it.

        Args:
            visit: Name of the visit.

        Raises:
            OSError: The visit cannot be read.
            ValueError: It lacks a frame in which differences are marked.
        """
        folder = self.path / visit
        frames = {frame.name: frame for frame in open_dataset(folder).frames}
        entries: list[tuple[Frame, Sequence[MarkedObject]]] = []
        for file, objects in self.marked.visits[visit].items():
            stem = Path(file).stem
            if stem not in frames:
                raise ValueError(f"{folder}: there is no frame {stem}; expected {file}")
            entries.append((frames[stem], objects))
        return entries

    def map(self) -> Path:
        """Return the folder of the map of the reference visit; make it once."""

        def make(folder: Path) -> None:
            dataset = open_dataset(self.reference)
            result = make_map(dataset, self.mapping.model_copy(update={"threads": 1}))
            write_result(folder, result, dataset.name)

        return cached_folder(self.work / "maps" / self.name, self.mapped_of, make)


def rooms_in(folder: Path, mapping: MappingConfig, work: Path) -> list[RealRoom]:
    """Return the rooms in a folder whose changed objects are marked.

    Args:
        folder: Folder with a folder per room.
        mapping: Settings of the mapping.
        work: Folder where everything made is kept.

    Raises:
        OSError: A visit cannot be read.
        ValueError: The folder has none of these rooms.
    """
    marked = marked_rooms()
    rooms = [
        RealRoom(folder / name, room, mapping, work)
        for name, room in marked.items()
        if (folder / name).is_dir()
    ]
    if not rooms:
        raise ValueError(f"{folder}: it has none of the folders {', '.join(marked)}")
    return rooms
