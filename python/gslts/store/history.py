"""What is known of the versions of a map, without its Gaussians."""

from __future__ import annotations

from pathlib import Path
from typing import Self

from gslts.store.index import Index
from gslts.store.manifest import require_versions
from gslts.store.records import Event, Rejection, Version

INDEX = "versions.sqlite"


class History:
    """The past of one map in a folder; a context manager.

    Args:
        folder: Of the map.
        writable: Whether the index may be written; the caller makes sure that one writer does.

    Raises:
        OSError: It cannot be read.
        ValueError: It is no map with versions, or one of a newer gslts.
    """

    def __init__(self, folder: Path, *, writable: bool = False) -> None:
        self._folder = folder
        self._index = Index(folder / INDEX, writable=writable)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Gives the index free."""
        self._index.close()

    @property
    def folder(self) -> Path:
        """Of the map."""
        return self._folder

    def versions(self) -> list[Version]:
        """All, the first one first."""
        return self._index.versions()

    def version(self, number: int | None = None) -> Version:
        """One of them; None means the newest.

        Raises:
            ValueError: There is no such version.
        """
        return self._index.newest() if number is None else self._index.version(number)

    def way_to(self, number: int | None = None) -> list[Version]:
        """The versions that a version was made of, the first one first, and itself.

        Raises:
            ValueError: There is no such version.
        """
        way = self.numbers_of_way_to(number)
        return [version for version in self.versions() if version.number in way]

    def numbers_of_way_to(self, number: int | None = None) -> set[int]:
        """Of the versions of `way_to`, which is much less to read.

        Raises:
            ValueError: There is no such version.
        """
        return set(self._index.way(self.version(number).number))

    def events(self, object_type: str | None = None) -> list[Event]:
        """What became of objects, of one type or of all."""
        return self._index.events(object_type)

    def events_between(self, before: int, after: int) -> tuple[list[Event], list[Event]]:
        """What became of objects from one version to another, and what is undone there.

        Where a version was restored, what it undid is on neither way.

        Args:
            before: Number of the one.
            after: Of the other.

        Raises:
            ValueError: There is no such version.
        """
        old, new = (self.numbers_of_way_to(number) for number in (before, after))
        events = self.events()
        done = [event for event in events if event.version in new - old]
        undone = [event for event in events if event.version in old - new]
        return done, undone

    def rejections(self) -> list[Rejection]:
        """The updates that were tried and changed nothing, the first one first."""
        return self._index.rejections()


def open_history(path: Path) -> History:
    """Opens the past of a map for reading.

    Args:
        path: Folder of the map.

    Raises:
        OSError: It cannot be read.
        ValueError: It is no folder of a map.
    """
    require_versions(path)
    return History(path)
