"""Version history of a map, without its Gaussians. Does not import NumPy."""

from __future__ import annotations

from pathlib import Path
from typing import Self

from gslts.store.index import Index
from gslts.store.manifest import require_map_folder
from gslts.store.records import Event, Rejection, Track, TrackEvent, Updates, Version
from gslts.store.tracks import object_tracks

INDEX = "versions.sqlite"
"""File name of the index in the folder of a map."""
MAX_NAMES = 12
"""Maximum number of objects that an error names: two lines of a terminal."""


class History:
    """Reads the versions of one map and what led to them. A context manager.

    Args:
        folder: Folder of the map.
        writable: Open the index for writing. The caller makes sure that there is one writer.

    Raises:
        OSError: The index cannot be read.
        ValueError: The folder holds no map, or one of another schema.
    """

    def __init__(self, folder: Path, *, writable: bool = False) -> None:
        self._folder = folder
        self._index = Index(folder / INDEX, writable=writable)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the index."""
        self._index.close()

    @property
    def folder(self) -> Path:
        """Folder of the map."""
        return self._folder

    def versions(self) -> list[Version]:
        """Return all versions, oldest first."""
        return self._index.versions()

    def version(self, number: int | None = None) -> Version:
        """Return a version.

        Args:
            number: Counted from 1; None means the newest.

        Returns:
            The version.

        Raises:
            ValueError: There is no such version.
        """
        return self._index.newest() if number is None else self._index.version(number)

    def lineage(self, number: int | None = None) -> list[Version]:
        """Return a version and all versions it was made from.

        Args:
            number: Of the version; None means the newest.

        Returns:
            Oldest first; the version itself is the last. Versions that a restore undid are not in
            it.

        Raises:
            ValueError: There is no such version.
        """
        numbers = self.lineage_numbers(number)
        return [version for version in self.versions() if version.number in numbers]

    def lineage_numbers(self, number: int | None = None) -> set[int]:
        """Return the numbers of the versions of `lineage`, which is much faster.

        Args:
            number: Of the version; None means the newest.

        Returns:
            The numbers.

        Raises:
            ValueError: There is no such version.
        """
        return set(self._index.lineage(self.version(number).number))

    def updates(self, number: int | None = None) -> Updates:
        """Return what the updates changed that led to a version.

        Args:
            number: Of the version; None means the newest.

        Raises:
            ValueError: There is no such version.
        """
        number = self.version(number).number
        numbers = set(self._index.lineage(number))
        boxes = [event.boxes for event in self._index.events() if event.version in numbers]
        return Updates.of_boxes(boxes, self._index.update_ids(number))

    def events(self) -> list[Event]:
        """Return the object changes as the updates found them, oldest first.

        Returns:
            The changes, also those that a restore undid.
        """
        return self._index.events()

    def changes_between(
        self, before: int, after: int
    ) -> tuple[list[tuple[Track, TrackEvent]], list[tuple[Track, TrackEvent]]]:
        """Return the object changes that separate two versions, each change of an object once.

        Args:
            before: Number of the first version.
            after: Number of the second version.

        Returns:
            Changes that only the second version shows, and changes that only the first one shows,
            with their objects, oldest first.

        Raises:
            ValueError: There is no such version.
        """
        old, new = (self.lineage_numbers(number) for number in (before, after))

        def told_in(numbers: set[int], tracks: list[Track]) -> list[tuple[Track, TrackEvent]]:
            found = [(track, event) for track in tracks for event in track.events]
            found = [(track, event) for track, event in found if event.version in numbers]
            return sorted(found, key=lambda pair: pair[1].version)

        only_before = told_in(old - new, self.tracks(before)) if old - new else []
        return told_in(new - old, self.tracks(after)), only_before

    def tracks(self, number: int | None = None) -> list[Track]:
        """Return the history of each object that changed.

        Args:
            number: Of a version; None means the newest. What a restore undid does not count.

        Returns:
            By the first change of each object.

        Raises:
            ValueError: There is no such version.
        """
        return object_tracks(self.lineage(number), self.events())

    def track(self, name: str) -> Track:
        """Return the history of one object.

        Args:
            name: Of the object, in any case.

        Raises:
            ValueError: No object of this name has changed.
        """
        tracks = self.tracks()
        for track in tracks:
            if track.name.lower() == name.lower():
                return track
        known = ", ".join(track.name for track in tracks[:MAX_NAMES]) or "none"
        more = f" and {len(tracks) - MAX_NAMES} more" if len(tracks) > MAX_NAMES else ""
        raise ValueError(
            f"{self._folder}: no object {name} has changed; objects that have: {known}{more}"
        )

    def rejections(self) -> list[Rejection]:
        """Return the rejected updates, oldest first."""
        return self._index.rejections()


def open_history(path: Path) -> History:
    """Open the history of a map for reading.

    Args:
        path: Folder of the map.

    Returns:
        The history.

    Raises:
        OSError: The folder cannot be read.
        ValueError: The path is no folder of a map.
    """
    require_map_folder(path)
    return History(path)
