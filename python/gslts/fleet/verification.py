"""Verification of own changes against the newest map of others, where both changed a region.

The frames of an update are not kept, but the own map remembers what they showed: its renderings
from their cameras stand for them. The detector compares the newest map with these, as it does with
frames.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from gslts.change.detector import ChangeDetector
from gslts.core.frame import RgbdFrame
from gslts.fleet.replica import Replica
from gslts.fleet.same_region import Attempt
from gslts.rendering.rendered_frame import render_frame
from gslts.store.camera_files import cameras_of_store
from gslts.store.causes import (
    ChangeRecord,
    ExtensionCause,
    RejectedUpdateCause,
    UpdateCause,
    UpdateRecord,
    VersionCause,
)
from gslts.store.delta import Delta, apply_deltas
from gslts.store.map_folder import camera_from_json
from gslts.store.measurement_files import read_measurements
from gslts.types import Bools, Floats, Floats32
from gslts.update.region import MAX_REGION_DISTANCE_M, Region
from gslts.update.verify import remaining_confidence

MAX_FRAMES = 6
"""Maximum number of frames that are rendered for an update. Each costs a rendering and two
detections; an update has about 12, and half of them show each side of a change."""


@dataclass(frozen=True, eq=False)
class Verdict:
    """Decision about a version of one clone.

    Attributes:
        delta: Changes to commit; None if nothing is left.
        kept: Rows of the changes of its cause that the new version shows.
        rejected: What is given up, with the reasons.
    """

    delta: Delta | None = None
    kept: Sequence[int] = ()
    rejected: Sequence[RejectedUpdateCause] = ()


def reject_all(cause: VersionCause, reason: str) -> Verdict:
    """Give up a whole version.

    Args:
        cause: Of the version.
        reason: For `gslts log`.
    """
    changes = cause.changes if isinstance(cause, UpdateCause) else ()
    return Verdict(rejected=[_rejection(cause, changes, reason)])


def verify_anew(replica: Replica, attempt: Attempt) -> Verdict:
    """Verify the changes of a version against the newest map of others.

    A change is given up if the newest map shows it already, or if others saw the same position
    later, by their clock. What is left must not show to the detector any more once it is applied.

    Args:
        replica: Clone of the map; its newest version is `attempt.head`.
        attempt: Of the same region as versions of others.

    Returns:
        The decision.

    Raises:
        OSError: A file cannot be read.
        ValueError: A file is damaged.
    """
    cause, rival = attempt.cause, attempt.describe_rival(attempt.boxes)
    if isinstance(cause, ExtensionCause):
        return reject_all(cause, f"{rival} changed the same space; run gslts extend again")
    assert isinstance(cause, UpdateCause)
    regions = [_regions(change) for change in cause.changes]
    frames = _remembered_frames(attempt, [region for own in regions for region in own])
    if not frames:
        return reject_all(cause, f"{rival} changed the same region; observe it again")
    cameras = [*cameras_of_store(replica).values(), *(frame.camera for frame in frames)]
    measurements = read_measurements(replica.folder)
    detector = ChangeDetector(
        attempt.head,
        cameras=cameras,
        measurements=measurements,
        updates=replica.updates(),
    )
    reasons = [
        _reason_to_give_up(attempt, change, _shows_change(detector, frames, own))
        for change, own in zip(cause.changes, regions, strict=True)
    ]
    delta = None
    while kept := [row for row, reason in enumerate(reasons) if reason is None]:
        delta = _restrict(attempt, regions, kept)
        after = detector.with_map(apply_deltas(attempt.head, [delta]), cameras)
        unfit = [row for row in kept if _shows_change(after, frames, regions[row])]
        if not unfit:
            break
        for row in unfit:
            rival = attempt.describe_rival(cause.changes[row].boxes)
            reasons[row] = f"it does not fit what {rival} shows; observe it again"
    rejected = [
        _rejection(cause, (change,), reason)
        for change, reason in zip(cause.changes, reasons, strict=True)
        if reason is not None
    ]
    return Verdict(delta if kept else None, kept, rejected)


def _reason_to_give_up(attempt: Attempt, change: ChangeRecord, is_missing: bool) -> str | None:
    """Return why a change is given up; None if the newest map should show it and does not."""
    if not is_missing:
        return f"the map shows it already, since {attempt.describe_rival(change.boxes)}"
    rivals = attempt.rivals(change.boxes, MAX_REGION_DISTANCE_M)
    if any(rival.version.time_s > attempt.own.version.time_s for rival in rivals):
        return f"{attempt.describe_rival(change.boxes)} saw the object later"
    return None


def _remembered_frames(attempt: Attempt, regions: Sequence[Region]) -> list[RgbdFrame]:
    """Render what the frames of an update showed; none if no frame with a region is recorded."""
    assert isinstance(attempt.cause, UpdateCause)
    cameras = [
        camera_from_json(frame.model_dump(exclude={"new_viewpoint"}))
        for frame in attempt.cause.frames
    ]
    seeing = [
        camera
        for camera in cameras
        if any(region.project_center(camera) is not None for region in regions)
    ]
    step = max(1, -(-len(seeing) // MAX_FRAMES))
    return [render_frame(attempt.after, camera) for camera in seeing[::step]]


def _shows_change(
    detector: ChangeDetector, frames: Sequence[RgbdFrame], regions: Sequence[Region]
) -> bool:
    """Return whether a detector reports a change in some regions."""
    found = remaining_confidence(detector, frames, regions)
    return found >= detector.config.objects.min_confidence


def _restrict(attempt: Attempt, regions: Sequence[Sequence[Region]], kept: Sequence[int]) -> Delta:
    """Return the part of a delta that belongs to some changes and applies to the newest map.

    A Gaussian belongs to the change with the nearest region.
    """
    delta, before, head = attempt.delta, attempt.before, attempt.head

    def belongs(means: Floats | Floats32) -> Bools:
        points = means + before.origin
        distances = [
            np.min([_distances_m(points, region) for region in own], axis=0) for own in regions
        ]
        return np.isin(np.argmin(distances, axis=0), kept)

    removed = delta.removed[belongs(before.means[np.searchsorted(before.ids, delta.removed)])]
    changed = delta.changed.select(np.flatnonzero(belongs(delta.changed.means)))
    return Delta(
        removed=removed[np.isin(removed, head.ids)],
        added=delta.added.select(np.flatnonzero(belongs(delta.added.means))),
        changed=changed.select(np.flatnonzero(np.isin(changed.ids, head.ids))),
    )


def _distances_m(points: Floats, region: Region) -> Floats:
    """Return the distances [P] of points from a box, m."""
    outside = np.maximum(np.maximum(region.low - points, points - region.high), 0)
    distances: Floats = np.linalg.norm(outside, axis=1)
    return distances


def _regions(change: ChangeRecord) -> list[Region]:
    """Return the regions of a change."""
    before, after = change.boxes
    regions = []
    if before is not None:
        regions.append(Region("before", *np.array(before)))
    if after is not None:
        regions.append(Region("after", *np.array(after)))
    return regions


def _rejection(
    cause: VersionCause, changes: tuple[ChangeRecord, ...], reason: str
) -> RejectedUpdateCause:
    number_of_round = cause.round if isinstance(cause, UpdateCause) else None
    return RejectedUpdateCause(
        round=number_of_round, changes=changes, record=UpdateRecord(rejected=reason)
    )
