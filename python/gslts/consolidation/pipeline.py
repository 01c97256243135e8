"""Consolidation of a map on disk: what updates changed since the last one becomes a version."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gslts.change.config import DetectionConfig
from gslts.change.detector import ChangeDetector
from gslts.consolidation.consolidate import Progress, consolidate
from gslts.core.robot import Robot
from gslts.store.camera_files import cameras_of_map, frame_records
from gslts.store.causes import ConsolidationCause, ConsolidationRecord, UpdateCause
from gslts.store.history import History
from gslts.store.map_folder import open_map
from gslts.store.map_store import MapStore
from gslts.store.measurement_files import read_measurements
from gslts.store.records import Version
from gslts.update.region import Region


@dataclass(frozen=True, eq=False)
class MapConsolidation:
    """Outcome of `consolidate_map`.

    Attributes:
        version: Newest version of the map after the call.
        record: Counts, times and quality; None if the map stays as it is.
        reason: Reason for leaving the map as it is; None if there is a new version.
        skipped: Reasons for skipping views.
    """

    version: Version
    record: ConsolidationRecord | None
    reason: str | None
    skipped: tuple[str, ...] = ()


def consolidate_map(
    path: Path | str,
    robot: Robot,
    *,
    detection: DetectionConfig | None = None,
    threads: int = 0,
    progress: Progress = lambda _: None,
) -> MapConsolidation:
    """Refine what updates have changed since the last consolidation, as a new version of a map.

    See `gslts.consolidation.consolidate`.

    Args:
        path: Folder of the map. The newest version is consolidated.
        robot: Takes the views.
        detection: Settings of the change detection; None means the defaults.
        threads: 0 uses all hardware threads.
        progress: Called after each view and after each step of the refinement.

    Returns:
        The outcome. Nothing to consolidate is a normal outcome, and writes nothing.

    Raises:
        OSError: A file cannot be read or written, or another process writes the map.
        ValueError: The path is no folder of a map, or too few views show a change.
    """
    with open_map(path, writable=True) as store:
        return consolidate_store(
            store, robot, detection=detection, threads=threads, progress=progress
        )


def consolidate_store(
    store: MapStore,
    robot: Robot,
    *,
    detection: DetectionConfig | None = None,
    threads: int = 0,
    progress: Progress = lambda _: None,
) -> MapConsolidation:
    """Consolidate an open map; see `consolidate_map`.

    Args:
        store: Of the map, open for writing.
        robot: Takes the views.
        detection: Settings of the change detection; None means the defaults.
        threads: 0 uses all hardware threads.
        progress: Called after each view and after each step of the refinement.

    Raises:
        OSError: A file cannot be read or written.
        ValueError: Too few views show a change.
    """
    newest = store.version()
    since, regions = touched_regions(store)
    if not regions:
        return MapConsolidation(newest, None, "nothing changed since the last consolidation")
    gaussian_map, cameras = store.read(), list(cameras_of_map(store.folder).values())
    detector = ChangeDetector(
        gaussian_map,
        detection,
        cameras=cameras,
        measurements=read_measurements(store.folder),
        updates=store.updates(),
    )
    done = consolidate(
        gaussian_map,
        cameras,
        regions,
        robot,
        detector=detector,
        threads=threads,
        progress=progress,
    )
    if done.delta is None or done.record is None:
        return MapConsolidation(newest, None, done.rejected, done.skipped)
    cause = ConsolidationCause(
        since=since, record=done.record, frames=frame_records(cameras, done.cameras)
    )
    return MapConsolidation(store.commit(done.delta, cause), done.record, None, done.skipped)


def touched_regions(store: History) -> tuple[int, list[Region]]:
    """Return the boxes of all changes since the last consolidation.

    Args:
        store: History of the map.

    Returns:
        Number of the first version after the last consolidation, and the boxes.
    """
    since, regions = 1, list[Region]()
    for version in store.lineage():
        if isinstance(version.cause, ConsolidationCause):
            since, regions = version.number + 1, []
        elif isinstance(version.cause, UpdateCause):
            boxes = [change.boxes for change in version.cause.changes]
            regions += [Region("before", *map(np.array, box)) for box, _ in boxes if box]
            regions += [Region("after", *map(np.array, box)) for _, box in boxes if box]
    return since, regions
