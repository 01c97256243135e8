"""Versions of a map on disk: each one is added atomically, and old ones stay readable."""

from __future__ import annotations

import logging
import time
from collections.abc import Sequence
from contextlib import closing
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

from gslts.core.gaussian_map import GaussianMap
from gslts.io.atomic_files import sync_folder
from gslts.store.blobs import Blobs
from gslts.store.causes import (
    ImportCause,
    MappingCause,
    RejectedUpdateCause,
    RestoreCause,
    SemanticsCause,
    ViewsCause,
)
from gslts.store.delta import (
    Delta,
    apply_deltas,
    compute_delta,
    delta_to_arrays,
    map_to_arrays,
    require_delta_of,
    require_rising_ids,
)
from gslts.store.history import INDEX
from gslts.store.index import Index
from gslts.store.map_reader import BLOBS, MapReader
from gslts.store.records import ObjectEvent, Rejection, Version
from gslts.store.robot_name import robot_name
from gslts.store.snapshot import write_snapshot
from gslts.store.writer_lock import lock_for_writing

_logger = logging.getLogger(__name__)


class MapStore(MapReader):
    """Reads and adds versions of one map. A context manager.

    A version is stored as a delta to its parent. A snapshot of all Gaussians is added as soon as
    the deltas since the last one take more bytes than it. Files of Gaussians are written before the
    index names them: a version exists as a whole or not at all, and readers see the versions that
    existed when they asked.

    Args:
        folder: Folder of the map.
        writable: Allow new versions; one process at a time can.

    Raises:
        OSError: The folder cannot be read, or another process writes it.
        ValueError: The folder holds no map, or one of another schema.
    """

    def __init__(self, folder: Path, *, writable: bool = False) -> None:
        self._lock = lock_for_writing(folder) if writable else None
        try:
            super().__init__(folder, writable=writable)
        except BaseException:
            self._unlock()
            raise
        if writable:
            self._blobs.remove_partial_files()

    @classmethod
    def create(
        cls, folder: Path, gaussian_map: GaussianMap, cause: MappingCause | ImportCause
    ) -> None:
        """Create the first version.

        Args:
            folder: Exists, and holds no versions.
            gaussian_map: With rising ids.
            cause: Origin of the map.

        Raises:
            OSError: The folder cannot be written, or holds versions already.
            ValueError: The ids do not rise.
        """
        require_rising_ids(gaussian_map, "gaussian_map")
        lock = lock_for_writing(folder)
        try:
            snapshot = write_snapshot(Blobs(folder / BLOBS), gaussian_map)
            version = Version(
                number=1,
                parent=None,
                gslts=metadata.version("gslts"),
                time_s=time.time(),
                gaussians=gaussian_map.size,
                next_id=gaussian_map.next_id,
                delta=None,
                touched=gaussian_map.size,
                cause=cause,
                robot=robot_name(),
            )
            with closing(Index(folder / INDEX, new=True)) as index:
                index.add(version, snapshot)
            sync_folder(folder)
        finally:
            lock.close()

    def close(self) -> None:
        """Close the store and release the writer lock."""
        super().close()
        self._unlock()

    def commit(
        self,
        change: GaussianMap | Delta,
        cause: ViewsCause,
        events: Sequence[ObjectEvent] = (),
    ) -> Version:
        """Add a version, durably: it is on disk when this returns.

        Args:
            change: Map made from the newest version: Gaussians that stay, in the same order, then
                new ones with ids of `next_id` or higher. Or how it differs from the newest version,
                as `compute_delta` returns it; the map is not read then.
            cause: Why the version exists.
            events: Object changes that it shows.

        Returns:
            The new version.

        Raises:
            OSError: A file cannot be written; then the newest version is still the old one.
            ValueError: The map was not made from the newest version.
        """
        return self._commit(change, cause, events)

    def _commit(
        self,
        change: GaussianMap | Delta,
        cause: ViewsCause,
        events: Sequence[ObjectEvent],
        **made: Any,
    ) -> Version:
        """Add a version; `made` replaces what it records of time, robot and program."""
        newest = self._index.newest()
        if isinstance(change, Delta):
            delta = change
            require_delta_of(delta, newest.gaussians, newest.next_id)
        else:
            delta = compute_delta(self.read(newest.number), change)
        if delta.added.size and int(delta.added.ids[0]) < newest.next_id:
            raise ValueError(
                f"commit: ids of new Gaussians must be {newest.next_id} or higher, "
                f"got {delta.added.ids[0]}"
            )
        version = self._after(
            newest,
            parent=newest.number,
            gaussians=newest.gaussians - len(delta.removed) + delta.added.size,
            next_id=max(newest.next_id, delta.added.next_id),
            delta=self._blobs.write(delta_to_arrays(delta)),
            touched=delta.touched,
            cause=cause,
            **made,
        )
        snapshot = None
        if self._needs_snapshot(version):
            if isinstance(change, Delta):
                change = apply_deltas(self.read(newest.number), [delta])
            snapshot = write_snapshot(self._blobs, change)
        self._index.add(version, snapshot, events)
        return version

    def commit_features(self, gaussian_map: GaussianMap, cause: SemanticsCause) -> Version:
        """Add a version that differs from the newest one only in its semantic features.

        Args:
            gaussian_map: The newest version with other features, also of another length.
            cause: Origin of the features.

        Returns:
            The new version.

        Raises:
            OSError: A file cannot be written; then the newest version is still the old one.
            ValueError: More than the features differ.
        """
        newest = self._index.newest()
        for name, array in map_to_arrays(self.read(newest.number)).items():
            if name != "features" and not np.array_equal(array, getattr(gaussian_map, name)):
                raise ValueError(
                    f"commit_features: {name} are not those of version {newest.number}"
                )
        version = self._after(
            newest,
            parent=newest.number,
            gaussians=gaussian_map.size,
            next_id=newest.next_id,
            delta=None,
            touched=gaussian_map.size,
            cause=cause,
        )
        self._index.add(version, write_snapshot(self._blobs, gaussian_map))
        return version

    def restore(self, number: int) -> Version:
        """Make an old version the newest one again; the versions between stay in the history.

        Args:
            number: Of the old version.

        Returns:
            The new version.

        Raises:
            OSError: A file cannot be written.
            ValueError: There is no such version, or a file of it is damaged.
        """
        old, newest = self.version(number), self._index.newest()
        self.read(number).view()  # A version that cannot be read is not restored.
        version = self._after(
            newest,
            parent=old.number,
            gaussians=old.gaussians,
            next_id=newest.next_id,
            delta=None,
            touched=0,
            cause=RestoreCause(version=old.number),
        )
        self._index.add(version)
        return version

    def add_rejection(self, cause: RejectedUpdateCause) -> None:
        """Record an update that was tried and left the map unchanged.

        Args:
            cause: The attempt and the reason.

        Raises:
            OSError: The index cannot be written.
        """
        newest = self._index.newest()
        rejection = Rejection(
            version=newest.number,
            gslts=metadata.version("gslts"),
            time_s=self._now_s(newest),
            cause=cause,
            robot=robot_name(),
        )
        self._index.add_rejection(rejection)

    def collect_garbage(self) -> int:
        """Remove files that no version needs, such as those of interrupted commits.

        Returns:
            Bytes freed.

        Raises:
            OSError: A file cannot be removed.
            ValueError: The index is damaged or a file is missing. Then nothing is removed, because
                any file may be the one that the index means.
        """
        self._index.require_intact()
        needed = {blob.key for blob in self._index.snapshots().values()}
        needed |= {version.delta.key for version in self.versions() if version.delta is not None}
        existing = set(self._blobs)
        if not needed <= existing:
            raise ValueError(
                f"{self._folder}: {len(needed - existing)} file(s) of its versions are missing; "
                "nothing was removed; gslts verify names them, copy them from a backup"
            )
        return sum(self._blobs.remove(key) for key in sorted(existing - needed))

    def compact(self, keep: int) -> int:
        """Remove the Gaussians of all but the newest versions; the history stays complete.

        Args:
            keep: Number of versions that stay readable, at least 1.

        Returns:
            Bytes freed.

        Raises:
            OSError: A file cannot be written or removed; no version to be kept is lost.
            ValueError: `keep` is not positive, or a version to be kept is damaged.
        """
        if keep < 1:
            raise ValueError(f"compact: keep must be positive, got {keep}")
        kept = self.versions()[-keep:]
        first, snapshots = kept[0].number, self._index.snapshots()
        for version in kept:
            orphaned = version.parent is None or version.parent < first
            if orphaned and version.number not in snapshots:
                snapshot = write_snapshot(self._blobs, self.read(version.number))
                self._index.add_snapshot(version.number, snapshot)
        self._index.forget_before(first)
        return self.collect_garbage()

    def _needs_snapshot(self, version: Version) -> bool:
        """Return whether the deltas since the last snapshot take more bytes than the snapshot."""
        assert version.parent is not None
        assert version.delta is not None
        snapshots = self._index.snapshots()
        start, deltas = self._reconstruction(version.parent, snapshots)
        return sum(delta.size for delta in (*deltas, version.delta)) > snapshots[start].size

    def _after(self, newest: Version, **fields: Any) -> Version:
        """Return the version after the newest one, made now by this robot."""
        if "time_s" not in fields:
            fields |= {
                "gslts": metadata.version("gslts"),
                "time_s": self._now_s(newest),
                "robot": robot_name(),
            }
        return Version(number=newest.number + 1, **fields)

    def _now_s(self, newest: Version) -> float:
        now_s = time.time()
        if now_s < newest.time_s:
            _logger.warning(
                "%s: the clock is %.0f s behind version %d; set it. Version numbers stay in order",
                self._folder,
                newest.time_s - now_s,
                newest.number,
            )
        return now_s

    def _unlock(self) -> None:
        if self._lock is not None:
            self._lock.close()
            self._lock = None
