"""A map with its past: versions that are added one by one, and never lost."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from gslts.core.gaussian_map import GaussianMap
from gslts.io.atomic_files import sync_folder
from gslts.store.blobs import Arrays, Blobs
from gslts.store.delta import (
    after_all,
    arrays_of,
    delta_from,
    delta_of,
    map_of,
    plain_delta,
    require_rising,
)
from gslts.store.history import INDEX, History
from gslts.store.index import Index
from gslts.store.records import Blob, Event, Rejection, Version
from gslts.store.writer_lock import writer_lock

BLOBS = "blobs"
_logger = logging.getLogger(__name__)


class MapStore(History):
    """The versions of one map in a folder; a context manager.

    A version is the changes that led to it, by the ids of Gaussians, and now and then a snapshot of
    all Gaussians, as soon as the changes since the last one take more bytes than it. Files of
    Gaussians are written before the index names them, so that a version is there whole or not at
    all, and readers see the versions that were there when they asked.

    Args:
        folder: Of the map.
        writable: Whether versions may be added; one process at a time may.

    Raises:
        OSError: It cannot be read, or another process writes it.
        ValueError: It is no map with versions, or one of a newer gslts.
    """

    def __init__(self, folder: Path, *, writable: bool = False) -> None:
        self._blobs = Blobs(folder / BLOBS)
        self._lock = writer_lock(folder) if writable else None
        try:
            super().__init__(folder, writable=writable)
        except BaseException:
            self._unlock()
            raise
        if writable:
            self._blobs.remove_parts()

    @classmethod
    def create(cls, folder: Path, gaussian_map: GaussianMap, cause: dict[str, Any]) -> None:
        """Makes the first version.

        Args:
            folder: Is there, and has no versions yet.
            gaussian_map: Its ids rise from Gaussian to Gaussian.
            cause: Where it is from, in values of JSON.

        Raises:
            OSError: It cannot be written, or there are versions already.
            ValueError: Ids do not rise.
        """
        require_rising(gaussian_map, "gaussian_map")
        lock = writer_lock(folder)
        try:
            key, size = Blobs(folder / BLOBS).write(arrays_of(gaussian_map))
            version = Version(
                number=1,
                parent=None,
                kind="base",
                time_s=time.time(),
                gaussians=gaussian_map.size,
                next_id=_next_id(gaussian_map, 0),
                delta=None,
                touched=gaussian_map.size,
                cause=cause,
            )
            with closing(Index(folder / INDEX, new=True)) as index:
                index.add(version, Blob(key, size))
            sync_folder(folder)
        finally:
            lock.close()

    def close(self) -> None:
        """Lets others write."""
        super().close()
        self._unlock()

    def read(self, number: int | None = None) -> GaussianMap:
        """A version of the map, bit by bit as it was.

        Args:
            number: None means the newest.

        Raises:
            OSError: A file is missing or cannot be read.
            ValueError: There is no such version, or a file is damaged.
        """
        known = self._index.snapshots()
        try:
            return self._read(number)
        except FileNotFoundError:
            if self._index.snapshots() == known:
                raise
            return self._read(number)  # Its writer compacted it meanwhile.

    def _read(self, number: int | None) -> GaussianMap:
        version = self.version(number)
        snapshots = self._index.snapshots()
        harm: OSError | ValueError | None = None
        while True:
            try:
                start, deltas = self._way_to(version.number, snapshots)
            except ValueError as error:
                raise harm or error from None
            snapshot = snapshots.pop(start.number)
            try:
                base = self._blobs.read(snapshot.key, snapshot.size)
                break
            except (OSError, ValueError) as error:
                harm = error  # What led to this version may still be there.
        if harm is not None:
            _logger.warning("%s. Version %d is read without it", harm, version.number)
        steps = [self._blobs.read(one.key, one.size) for one in deltas]
        try:
            return after_all(map_of(base), map(delta_from, steps))
        except ValueError as error:
            raise ValueError(f"{self._folder}: version {version.number}: {error}") from error

    def commit(
        self, gaussian_map: GaussianMap, cause: dict[str, Any], events: Sequence[Event] = ()
    ) -> Version:
        """Adds a version, which is on the disk for good when this returns.

        Args:
            gaussian_map: Made of the newest version: what stayed in its order, then what is new,
                with ids of `next_id` or higher.
            cause: Why, in values of JSON.
            events: What became of objects; their version is set.

        Raises:
            OSError: It cannot be written; then the newest version is what it was.
            ValueError: It was not made of the newest version.
        """
        newest = self._index.newest()
        before = self.read(newest.number)
        delta = delta_of(before, gaussian_map)
        if delta.added.size and int(delta.added.ids[0]) < newest.next_id:
            raise ValueError(
                f"commit: ids of new Gaussians must be {newest.next_id} or higher, "
                f"got {delta.added.ids[0]}"
            )
        version = Version(
            number=newest.number + 1,
            parent=newest.number,
            kind="update",
            time_s=self._now_s(newest),
            gaussians=gaussian_map.size,
            next_id=_next_id(gaussian_map, newest.next_id),
            delta=self._written(plain_delta(delta)),
            touched=delta.touched,
            cause=cause,
        )
        known = [replace(one, version=version.number) for one in events]
        snapshot = None
        if self._is_far(version):
            snapshot = self._written(arrays_of(gaussian_map))
        self._index.add(version, snapshot, known)
        return version

    def commit_features(self, gaussian_map: GaussianMap, cause: dict[str, Any]) -> Version:
        """Adds a version whose Gaussians are those of the newest one, but for their features.

        Args:
            gaussian_map: The newest version with other features, also of another length.
            cause: Where they are from, in values of JSON.

        Raises:
            OSError: It cannot be written; then the newest version is what it was.
            ValueError: More than the features differ.
        """
        newest = self._index.newest()
        before = self.read(newest.number)
        for name, array in arrays_of(before).items():
            if name != "features" and not np.array_equal(array, getattr(gaussian_map, name)):
                raise ValueError(
                    f"commit_features: {name} are not those of version {newest.number}"
                )
        version = Version(
            number=newest.number + 1,
            parent=newest.number,
            kind="semantics",
            time_s=self._now_s(newest),
            gaussians=gaussian_map.size,
            next_id=newest.next_id,
            delta=None,
            touched=gaussian_map.size,
            cause=cause,
        )
        self._index.add(version, self._written(arrays_of(gaussian_map)))
        return version

    def add_rejection(self, cause: dict[str, Any]) -> None:
        """Notes an update that was tried and changed nothing.

        Args:
            cause: What was tried and why not, in values of JSON.

        Raises:
            OSError: It cannot be written.
        """
        newest = self._index.newest()
        self._index.add_rejection(Rejection(newest.number, self._now_s(newest), cause))

    def restore(self, number: int) -> Version:
        """Makes an old version the newest one again; those between stay in the past.

        Raises:
            OSError: It cannot be written.
            ValueError: There is no such version, or a file of it is damaged.
        """
        wanted, newest = self.version(number), self._index.newest()
        self.read(number)  # What cannot be read is not restored.
        version = Version(
            number=newest.number + 1,
            parent=wanted.number,
            kind="restore",
            time_s=self._now_s(newest),
            gaussians=wanted.gaussians,
            next_id=newest.next_id,
            delta=None,
            touched=0,
            cause={"restored": wanted.number},
        )
        self._index.add(version)
        return version

    def problems(self, tell: Callable[[], None] = lambda: None) -> list[str]:
        """Every file that is missing or damaged, in one line each; none if all is well.

        Args:
            tell: Is told of each version that was looked at.
        """
        while True:
            versions, snapshots = self.versions(), self._index.snapshots()
            found = self._problems(versions, snapshots, tell)
            same = (versions, snapshots) == (self.versions(), self._index.snapshots())
            if not found or same:  # A writer may have compacted it meanwhile.
                return found

    def _problems(
        self, versions: list[Version], snapshots: dict[int, Blob], tell: Callable[[], None]
    ) -> list[str]:
        found = []
        try:
            self._index.require_whole()
        except (OSError, ValueError) as error:
            found.append(str(error))
        for version in versions:
            for blob in (version.delta, snapshots.get(version.number)):
                try:
                    if blob is not None:
                        self._blobs.verify(blob.key, blob.size)
                except (OSError, ValueError) as error:
                    found.append(f"version {version.number}: {error}")
            tell()
        return found

    def collect_garbage(self) -> int:
        """Removes files that no version needs, such as those of commits that were stopped.

        Returns:
            The bytes that were freed.

        Raises:
            OSError: A file cannot be removed.
            ValueError: The index is damaged, or a file is missing: then any may be the one that it
                meant.
        """
        self._index.require_whole()
        snapshots = self._index.snapshots()
        needed = {blob.key for blob in snapshots.values()}
        needed |= {one.delta.key for one in self.versions() if one.delta is not None}
        there = set(self._blobs)
        if not needed <= there:
            raise ValueError(
                f"{self._folder}: {len(needed - there)} file(s) of its versions are missing; "
                "nothing was removed: gslts verify tells which, copy them from a backup"
            )
        return sum(self._blobs.remove(key) for key in sorted(there - needed))

    def compact(self, keep: int) -> int:
        """Forgets the Gaussians of all but the newest versions; what happened stays known.

        Args:
            keep: How many can still be read then, at least 1.

        Returns:
            The bytes that were freed.

        Raises:
            OSError: Something cannot be written or removed; no version that is kept is lost.
            ValueError: `keep` is not positive, or a version to be kept is damaged.
        """
        if keep < 1:
            raise ValueError(f"compact: keep must be positive, got {keep}")
        versions = self.versions()
        kept = versions[-keep:]
        first, snapshots = kept[0].number, self._index.snapshots()
        for version in kept:
            stands_alone = version.parent is None or version.parent < first
            if stands_alone and version.number not in snapshots:
                whole = self._written(arrays_of(self.read(version.number)))
                self._index.add_snapshot(version.number, whole)
        self._index.forget_before(first)
        return self.collect_garbage()

    def _way_to(self, number: int, snapshots: Mapping[int, Blob]) -> tuple[Version, list[Blob]]:
        """The version of the snapshot to start from, and the deltas that lead on from there."""
        deltas: list[Blob] = []
        for one in self._index.way(number):
            version = self._index.version(one)
            if one in snapshots:
                return version, deltas[::-1]
            if version.delta is not None:
                deltas.append(version.delta)
            if version.kind == "semantics":
                break
        raise ValueError(
            f"{self._folder}: version {number} was compacted and cannot be read any more; "
            "gslts log tells what is known of it"
        )

    def _is_far(self, version: Version) -> bool:
        """Whether its deltas since the last snapshot take more bytes than that."""
        assert version.parent is not None
        assert version.delta is not None
        snapshots = self._index.snapshots()
        start, deltas = self._way_to(version.parent, snapshots)
        return sum(one.size for one in (*deltas, version.delta)) > snapshots[start.number].size

    def _written(self, arrays: Arrays) -> Blob:
        return Blob(*self._blobs.write(arrays))

    def _now_s(self, newest: Version) -> float:
        now_s = time.time()
        if now_s < newest.time_s:
            _logger.warning(
                "%s: the clock is %.0f s behind that of version %d; set it. Versions count on",
                self._folder,
                newest.time_s - now_s,
                newest.number,
            )
        return now_s

    def _unlock(self) -> None:
        if self._lock is not None:
            self._lock.close()
            self._lock = None


def _next_id(gaussian_map: GaussianMap, least: int) -> int:
    return max(least, int(gaussian_map.ids[-1]) + 1) if gaussian_map.size else least
