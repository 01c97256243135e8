"""Checks of the files of versions against their checksums."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from gslts.store.blobs import Blobs
from gslts.store.index import Index
from gslts.store.records import Snapshot, Version
from gslts.store.snapshot import require_intact


def find_problems(
    index: Index,
    blobs: Blobs,
    versions: Sequence[Version],
    snapshots: Mapping[int, Snapshot],
    progress: Callable[[], None],
) -> list[str]:
    """Check the index, and every file of some versions against its checksum.

    Args:
        index: Index of the versions.
        blobs: Files of the versions.
        versions: Versions to check.
        snapshots: Snapshots by number of the version.
        progress: Called after each version.

    Returns:
        One line for each file that is missing or damaged, which names the block of a snapshot;
        empty if all is well.
    """
    problems = []
    try:
        index.require_intact()
    except (OSError, ValueError) as error:
        problems.append(str(error))
    for version in versions:
        for blob in (version.delta, snapshots.get(version.number)):
            try:
                if blob is not None:
                    require_intact(blobs, blob)
            except (OSError, ValueError) as error:
                problems.append(f"version {version.number}: {error}")
        progress()
    return problems
