"""Reading of the versions of a map with their Gaussians."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from gslts.core.gaussian_map import MIN_BOUNDED, GaussianMap
from gslts.store.blobs import Blobs
from gslts.store.causes import SemanticsCause
from gslts.store.delta import apply_deltas, delta_from_arrays, map_from_arrays
from gslts.store.history import History
from gslts.store.records import Blob, Snapshot
from gslts.store.snapshot import PREFIX, open_snapshot
from gslts.store.verification import find_problems

BLOBS = "blobs"
"""Folder of the files of arrays, in the folder of a map."""
_logger = logging.getLogger(__name__)


class MapReader(History):
    """Reads versions of one map. A context manager; see `MapStore`, which also adds versions.

    Args:
        folder: Folder of the map.
        writable: Open the index for writing. The caller makes sure that there is one writer.

    Raises:
        OSError: The folder cannot be read.
        ValueError: The folder holds no map, or one of another schema.
    """

    def __init__(self, folder: Path, *, writable: bool = False) -> None:
        self._blobs = Blobs(folder / BLOBS)
        super().__init__(folder, writable=writable)

    def read(self, number: int | None = None) -> GaussianMap:
        """Read a version of the map, bit by bit as it was committed.

        Args:
            number: Counted from 1; None means the newest.

        Returns:
            The map. The Gaussians of a large one are read when they are asked for, also after the
            store was closed or compacted.

        Raises:
            OSError: A file is missing or cannot be read.
            ValueError: There is no such version, or a file is damaged.
        """
        snapshots = self._index.snapshots()
        try:
            return self._read(number)
        except FileNotFoundError:
            if self._index.snapshots() == snapshots:
                raise
            return self._read(number)  # A writer compacted the store meanwhile.

    def find_problems(self, progress: Callable[[], None] = lambda: None) -> list[str]:
        """Check every file of every version against its checksum.

        Args:
            progress: Called after each version.

        Returns:
            One line for each file that is missing or damaged; empty if all is well.
        """
        while True:
            versions, snapshots = self.versions(), self._index.snapshots()
            problems = find_problems(self._index, self._blobs, versions, snapshots, progress)
            same = (versions, snapshots) == (self.versions(), self._index.snapshots())
            if not problems or same:  # Otherwise a writer compacted the store meanwhile.
                return problems

    def _read(self, number: int | None) -> GaussianMap:
        version = self.version(number)
        snapshots = self._index.snapshots()
        damage: OSError | ValueError | None = None
        while True:
            try:
                start, deltas = self._reconstruction(version.number, snapshots)
            except ValueError as error:
                raise damage or error from None
            try:
                base = self._open_snapshot(start, snapshots.pop(start))
                break
            except (OSError, ValueError) as error:
                damage = error  # An older snapshot and more deltas lead to the same version.
        if damage is not None:
            _logger.warning("%s. Version %d is read without it", damage, version.number)
        steps = [self._blobs.read(delta) for delta in deltas]
        try:
            return apply_deltas(base, map(delta_from_arrays, steps))
        except ValueError as error:
            raise ValueError(f"{self._folder}: version {version.number}: {error}") from error

    def _open_snapshot(self, number: int, snapshot: Snapshot) -> GaussianMap:
        """Return the map of the snapshot of a version; a small one is read as a whole."""
        if snapshot.head is None:
            arrays = self._blobs.read(snapshot)
            names = [name for name in arrays if not name.startswith(PREFIX)]
            return map_from_arrays({name: arrays[name] for name in names})
        path = self._blobs.path(snapshot.key)
        gaussian_map = open_snapshot(path, snapshot, f"version {number}: {path}")
        is_small = gaussian_map.size < MIN_BOUNDED
        return gaussian_map.select(np.arange(gaussian_map.size)) if is_small else gaussian_map

    def _reconstruction(
        self, number: int, snapshots: Mapping[int, Snapshot]
    ) -> tuple[int, list[Blob]]:
        """Return the version with a snapshot to start from, and the deltas to apply to it."""
        deltas: list[Blob] = []
        for ancestor in self._index.lineage(number):
            if ancestor in snapshots:
                return ancestor, deltas[::-1]
            version = self._index.version(ancestor)
            if version.delta is not None:
                deltas.append(version.delta)
            if isinstance(version.cause, SemanticsCause):
                break
        raise ValueError(
            f"{self._folder}: version {number} was compacted and cannot be read any more; "
            "gslts log shows its record"
        )
