"""Update of a map on disk by one robot: detect, collect, edit, refine, verify, publish.

Source: GS-LTS, sec. III-C and III-D.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from gslts.change.changes import Change
from gslts.change.config import DetectionConfig
from gslts.change.confirmation import MonitorConfig
from gslts.change.detector import ChangeDetector
from gslts.change.monitor import confirm_changes
from gslts.core.frame import RgbdFrame
from gslts.core.robot import Robot
from gslts.semantics.map_semantics import MapSemantics
from gslts.store.camera_files import cameras_of_map
from gslts.store.causes import RejectedUpdateCause, UpdateRecord
from gslts.store.map_folder import open_map
from gslts.store.measurement_files import read_measurements
from gslts.store.records import Version
from gslts.update.config import UpdateConfig
from gslts.update.integrate import Progress, UpdateResult, integrate_changes
from gslts.update.publish import publish


@dataclass(frozen=True, eq=False)
class MapUpdate:
    """Outcome of `update_map`.

    Attributes:
        status: "updated" with a new version; "unchanged" if no change was detected; "rejected" if
            the changes could not be confirmed, or too few frames can be compared with the map.
        version: Newest version of the map after the call.
        reason: Reason for the rejection; None otherwise.
        result: Changes, views and record; None if no change was detected.
    """

    status: Literal["updated", "unchanged", "rejected"]
    version: Version
    reason: str | None = None
    result: UpdateResult | None = None


def update_map(
    path: Path | str,
    robot: Robot,
    config: UpdateConfig | None = None,
    *,
    detection: DetectionConfig | None = None,
    frames: Sequence[RgbdFrame] | None = None,
    monitor: MonitorConfig | None = None,
    on_detected: Callable[[Sequence[Change]], None] = lambda _: None,
    progress: Progress = lambda _: None,
) -> MapUpdate:
    """Detect changes, collect views of them, and publish a version of the map that shows them.

    Args:
        path: Folder of the map. The newest version is updated; old versions stay readable.
        robot: Collects the views.
        config: Settings of the update; None means the defaults.
        detection: Settings of the change detection; None means the defaults.
        frames: Frames in which changes are detected, at least as many as must show a change; those
            that show one are views of it. None means one frame that the robot observes where it is.
        monitor: Settings of the confirmation over several frames; None means the defaults.
        on_detected: Called with the detected changes, before views are collected.
        progress: Called after each step of the stages that take long.

    Returns:
        The outcome. No change is a normal outcome, and writes nothing.

    Raises:
        OSError: A file cannot be read or written, or another process writes the map.
        ValueError: The path is no folder of a map, a file is damaged, or there are too few frames.
    """
    path = Path(path)
    config = UpdateConfig() if config is None else config
    with open_map(path, writable=True) as store:
        newest, gaussian_map = store.version(), store.read()
        cameras = list(cameras_of_map(path).values())
        semantics = MapSemantics.of_map(path, config.threads)
        detector = ChangeDetector(
            gaussian_map,
            detection,
            cameras=cameras,
            measurements=read_measurements(path),
            updates=store.updates(),
        )
        changes, fault = _detect(detector, robot, frames, monitor)
        if fault is not None:
            store.add_rejection(RejectedUpdateCause(record=UpdateRecord(rejected=fault)))
            return MapUpdate("rejected", newest, fault)
        if not changes:
            return MapUpdate("unchanged", newest)
        on_detected(changes)
        result = integrate_changes(
            gaussian_map,
            cameras,
            changes,
            robot,
            config,
            detector=detector,
            recorded=frames or (),
            first_id=newest.next_id,
            semantics=semantics,
            progress=progress,
        )
        version = publish(store, gaussian_map, cameras, result, config, semantics=semantics)
    if version is None:
        return MapUpdate("rejected", newest, result.rejected, result)
    return MapUpdate("updated", version, None, result)


def _detect(
    detector: ChangeDetector,
    robot: Robot,
    frames: Sequence[RgbdFrame] | None,
    monitor: MonitorConfig | None,
) -> tuple[Sequence[Change], str | None]:
    """Return the detected changes, or the reason why frames cannot be compared with the map."""
    if frames is None:
        detected = detector.detect(robot.observe())
        return detected.changes, detected.unreliable
    monitor = monitor or MonitorConfig()
    changes, counts = confirm_changes(detector, frames, monitor)
    usable = counts.processed - counts.unreliable
    if changes or usable >= monitor.needed:
        return changes, None
    if usable == 0:
        return (), (
            f"none of {counts.processed} frames can be compared with the map; "
            "gslts detect names the reasons"
        )
    return (), (
        f"only {usable} of {counts.processed} frames can be compared with the map, "
        f"{monitor.needed} must show a change (--needed); gslts detect names the reasons"
    )
