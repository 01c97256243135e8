"""Active data collection: views around the detected changes, and the changes that they confirm.

Source: GS-LTS, sec. III-D, Active Data Collection.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from gslts.change.changes import Change
from gslts.change.constants import MAX_FINE_QUANTUM_M
from gslts.change.detection import Detection
from gslts.change.detector import ChangeDetector
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.core.robot import Robot
from gslts.store.records import NO_UPDATES, Updates
from gslts.types import Bools, Indices
from gslts.update.config import CollectConfig
from gslts.update.evidence import confirm, join_parts, join_shifts
from gslts.update.extent import extend_regions
from gslts.update.region import MAX_REGION_DISTANCE_M, Region, regions_of
from gslts.update.rigid_motion import move_gaussians, select_shifted
from gslts.update.shift_registration import register_shift
from gslts.update.tour import Tour
from gslts.update.views import (
    View,
    align_view,
    bring_to_front,
    pixels_in_region,
    region_masks,
    render_view,
    view_from_detection,
)

DetectedView = tuple[View, Detection]


@dataclass(frozen=True, eq=False)
class Collection:
    """Views around changes.

    Attributes:
        views: In the order in which they were taken.
        changes: Changes that the views confirm.
        regions_by_change: Regions of each of these changes, as the views show them.
        moved: [N] bool for each of these changes: Gaussians that a shift moved, which the views
            compare with the frames at their new positions.
        rejected: Changes that the views do not confirm, with the reasons.
        skipped: Reasons for skipping other frames.
    """

    views: tuple[View, ...]
    changes: tuple[Change, ...]
    regions_by_change: tuple[tuple[Region, ...], ...]
    moved: tuple[Bools, ...]
    rejected: tuple[tuple[Change, str], ...]
    skipped: tuple[str, ...]

    @property
    def regions(self) -> tuple[Region, ...]:
        """Regions of all confirmed changes."""
        return tuple(region for regions in self.regions_by_change for region in regions)

    def move(self, gaussian_map: GaussianMap) -> GaussianMap:
        """Return the map with the Gaussians of shifted objects at their new positions.

        Args:
            gaussian_map: Map before the update.
        """
        for change, rows in zip(self.changes, self.moved, strict=True):
            if change.motion is not None and rows.any():
                gaussian_map = move_gaussians(gaussian_map, rows, change.motion)
        return gaussian_map

    def of_part(self, rows: Indices) -> Collection:
        """Return the collection for some Gaussians of the map.

        Args:
            rows: [M] rows of the map before the update.
        """
        return replace(self, moved=tuple(marks[rows] for marks in self.moved))

    def reject(
        self, reasons: Sequence[str | None], gaussian_map: GaussianMap, threads: int = 0
    ) -> Collection:
        """Return the collection without some changes.

        Args:
            reasons: Reason for rejecting each change; None keeps it.
            gaussian_map: Map before the update.
            threads: 0 uses all hardware threads.
        """
        kept = [row for row, reason in enumerate(reasons) if reason is None]
        rejected = [
            (change, reason)
            for change, reason in zip(self.changes, reasons, strict=True)
            if reason is not None
        ]
        left = replace(
            self,
            changes=tuple(self.changes[row] for row in kept),
            regions_by_change=tuple(self.regions_by_change[row] for row in kept),
            moved=tuple(self.moved[row] for row in kept),
            rejected=(*self.rejected, *rejected),
        )
        views = [_in_regions(view, left.regions) for view in self.views]
        if any(rows.any() and why for rows, why in zip(self.moved, reasons, strict=True)):
            views = [render_view(view, left.move(gaussian_map), threads) for view in views]
        return replace(left, views=tuple(views))

    def separate(self, apart: Sequence[bool]) -> Collection:
        """Return the collection with some relocations as a removal and an addition each.

        Args:
            apart: Of each change, True for such relocations.
        """
        parts: list[tuple[Change, tuple[Region, ...], Bools]] = []
        for change, regions, rows, unlike in zip(
            self.changes, self.regions_by_change, self.moved, apart, strict=True
        ):
            if unlike:
                parts += [(change.end(region.side), (region,), rows) for region in regions]
            else:
                parts.append((change, regions, rows))
        changes, regions_by_change, moved = zip(*parts, strict=True)
        return replace(self, changes=changes, regions_by_change=regions_by_change, moved=moved)


def collect_views(
    robot: Robot,
    detector: ChangeDetector,
    changes: Sequence[Change],
    config: CollectConfig,
    *,
    recorded: Sequence[RgbdFrame] = (),
    rigid: bool = True,
    threads: int = 0,
    progress: Callable[[], None] = lambda: None,
) -> Collection:
    """Move a robot around each changed region, and confirm the changes by the frames.

    Args:
        robot: Near the regions.
        detector: Of the map before the update.
        changes: As detected.
        config: Settings.
        recorded: Frames taken before; those that show a region are views as well.
        rigid: Move the Gaussians of shifted objects, and compare the frames with them.
        threads: 0 uses all hardware threads.
        progress: Called after each step of the robot.

    Returns:
        The views and the confirmed changes; no view if no position around a region is reachable.
    """
    changes, parts = join_parts(changes)
    regions = [region for change in changes for region in regions_of(change)]
    tour = Tour(robot, detector, regions, config, progress, recorded)
    for index in range(len(regions)):
        tour.visit(index)
    remaining = iter(tour.regions)
    by_change = [list(islice(remaining, len(regions_of(change)))) for change in changes]
    views = _align(tour, tour.frames, detector.gaussian_map.without_features(), threads)
    results = [
        confirm(change, own, views, tour.skipped)
        for change, own in zip(changes, by_change, strict=True)
    ]
    results = join_shifts(results)
    shown = [view for view, _ in views] if rigid else []
    results, moved = _move_shifted(detector.gaussian_map, results, by_change, shown, threads)
    if any(rows.any() for rows in moved):
        detector = _detector_of_moved(detector, results, moved)
        frames = [(frame, detector.detect(frame)) for frame, _ in tour.frames]
        views = _align(tour, frames, detector.gaussian_map.without_features(), threads)
        results = [
            result if change.kind == "shift" else confirm(change, own, views, tour.skipped)
            for change, own, result in zip(changes, by_change, results, strict=True)
        ]
    confirmed = [
        (result, _regions_of_confirmed(result, own), rows)
        for result, own, rows in zip(results, by_change, moved, strict=True)
        if not isinstance(result, str)
    ]
    regions = [region for _, own, _ in confirmed for region in own]
    masked = []
    for view, detection in views:
        before, after = region_masks(detection, view.changed.shape, regions)
        view = replace(view, before=before, after=after)
        if view.depth_quantum_m > MAX_FINE_QUANTUM_M:
            view = bring_to_front(view)
        masked.append(view)
    grown, masked_views = extend_regions(regions, masked)
    remaining = iter(grown)
    return Collection(
        views=masked_views,
        changes=tuple(change for change, _, _ in confirmed),
        regions_by_change=tuple(tuple(islice(remaining, len(own))) for _, own, _ in confirmed),
        moved=tuple(rows for _, _, rows in confirmed),
        rejected=(
            *((part, "it is a part of another change") for part in parts),
            *(
                (change, result)
                for change, result in zip(changes, results, strict=True)
                if isinstance(result, str)
            ),
        ),
        skipped=tuple(tour.skipped),
    )


def _in_regions(view: View, regions: Sequence[Region]) -> View:
    """Return a view whose masks have only what lies in some regions."""
    masks = {}
    for side, depth in (("before", view.rendered_depth), ("after", view.depth)):
        inside = np.zeros(view.changed.shape, np.bool_)
        for region in regions:
            if region.side == side:
                inside |= pixels_in_region(depth, view.camera, region, MAX_REGION_DISTANCE_M)
        masks[side] = inside
    return replace(view, before=view.before & masks["before"], after=view.after & masks["after"])


def _align(
    tour: Tour,
    frames: Sequence[tuple[RgbdFrame, Detection]],
    gaussian_map: GaussianMap,
    threads: int,
) -> list[DetectedView]:
    """Return views of frames, aligned with the map; notes those that cannot be aligned."""
    views = []
    for frame, detection in frames:
        view = view_from_detection(detection, frame, tour.regions)
        if view is not None:
            view = align_view(view, gaussian_map, threads)
        if view is None:
            tour.skipped.append("a frame fits the map at another pose")
        else:
            views.append((view, detection))
    return views


def _move_shifted(
    gaussian_map: GaussianMap,
    results: Sequence[Change | str],
    by_change: Sequence[Sequence[Region]],
    views: Sequence[View],
    threads: int,
) -> tuple[list[Change | str], list[Bools]]:
    """Return the changes with registered motions, and [N] Gaussians that each of them moves."""
    registered: list[Change | str] = []
    moved: list[Bools] = []
    taken = np.zeros(gaussian_map.size, np.bool_)
    for result, own in zip(results, by_change, strict=True):
        rows = np.zeros(gaussian_map.size, np.bool_)
        if not isinstance(result, str) and result.motion is not None:
            regions = _regions_of_confirmed(result, own)
            rows = select_shifted(gaussian_map, views, regions, result.motion) & ~taken
            if rows.any():
                motion = register_shift(gaussian_map, rows, views, result.motion, threads)
                result = replace(result, motion=motion)
                rows = select_shifted(gaussian_map, views, regions, motion) & ~taken
        taken |= rows
        moved.append(rows)
        registered.append(result)
    return registered, moved


def _detector_of_moved(
    detector: ChangeDetector, results: Sequence[Change | str], moved: Sequence[Bools]
) -> ChangeDetector:
    """Return the detector of the map in which shifted objects are at their new positions."""
    gaussian_map, shifted = detector.gaussian_map, NO_UPDATES
    for result, rows in zip(results, moved, strict=True):
        if not isinstance(result, str) and result.motion is not None and rows.any():
            gaussian_map = move_gaussians(gaussian_map, rows, result.motion)
            shifted = shifted.then(Updates.of_boxes([result.boxes]))
    return detector.with_map(gaussian_map, detector.cameras, shifted)


def _regions_of_confirmed(change: Change, visited: Sequence[Region]) -> tuple[Region, ...]:
    """Return the regions of a confirmed change.

    They are as large as the views show them; those of a shift have the boxes of all reports of it,
    because the surfaces of its edges may be those of other objects.
    """
    regions = regions_of(change)
    if change.kind == "shift":
        return regions
    sides = [region.side for region in regions]
    return tuple(region for region in visited if region.side in sides)
