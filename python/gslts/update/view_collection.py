"""Active data collection: views around the detected changes, and the changes that they confirm.

Source: GS-LTS, sec. III-D, Active Data Collection.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from gslts.change.changes import Change
from gslts.change.detector import ChangeDetector, Detection
from gslts.core.frame import RgbdFrame
from gslts.core.robot import Robot
from gslts.update.config import CollectConfig
from gslts.update.evidence import confirm
from gslts.update.extent import extend_regions
from gslts.update.region import NEAR_M, Region, regions_of
from gslts.update.tour import Tour
from gslts.update.views import (
    View,
    align_view,
    bring_to_front,
    pixels_in_region,
    region_masks,
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
        rejected: Changes that the views do not confirm, with the reasons.
        skipped: Reasons for skipping other frames.
    """

    views: tuple[View, ...]
    changes: tuple[Change, ...]
    regions_by_change: tuple[tuple[Region, ...], ...]
    rejected: tuple[tuple[Change, str], ...]
    skipped: tuple[str, ...]

    @property
    def regions(self) -> tuple[Region, ...]:
        """Regions of all confirmed changes."""
        return tuple(region for regions in self.regions_by_change for region in regions)

    def reject(self, reasons: Sequence[str | None]) -> Collection:
        """Return the collection without some changes.

        Args:
            reasons: Reason for rejecting each change; None keeps it.
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
            rejected=(*self.rejected, *rejected),
        )
        return replace(left, views=tuple(_in_regions(view, left.regions) for view in self.views))


def collect_views(
    robot: Robot,
    detector: ChangeDetector,
    changes: Sequence[Change],
    config: CollectConfig,
    *,
    recorded: Sequence[RgbdFrame] = (),
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
        threads: 0 uses all hardware threads.
        progress: Called after each step of the robot.

    Returns:
        The views and the confirmed changes; no view if no position around a region is reachable.
    """
    regions = [region for change in changes for region in regions_of(change)]
    tour = Tour(robot, detector, regions, config, progress, recorded)
    for index in range(len(regions)):
        tour.visit(index)
    views = _align(tour, detector, threads)
    confirmed, rejected = _confirm(changes, tour, views)
    regions = [region for _, own in confirmed for region in own]
    masked = []
    for view, detection in views:
        before, after = region_masks(detection, view.changed.shape, regions)
        view = replace(view, before=before, after=after)
        if view.depth_quantum_m > detector.config.objects.step_m:
            view = bring_to_front(view)
        masked.append(view)
    grown, masked_views = extend_regions(regions, masked)
    remaining = iter(grown)
    return Collection(
        views=masked_views,
        changes=tuple(change for change, _ in confirmed),
        regions_by_change=tuple(tuple(islice(remaining, len(own))) for _, own in confirmed),
        rejected=tuple(rejected),
        skipped=tuple(tour.skipped),
    )


def _in_regions(view: View, regions: Sequence[Region]) -> View:
    """Return a view whose masks have only what lies in some regions."""
    masks = {}
    for side, depth in (("before", view.rendered_depth), ("after", view.depth)):
        inside = np.zeros(view.changed.shape, np.bool_)
        for region in regions:
            if region.side == side:
                inside |= pixels_in_region(depth, view.camera, region, NEAR_M)
        masks[side] = inside
    return replace(view, before=view.before & masks["before"], after=view.after & masks["after"])


def _align(tour: Tour, detector: ChangeDetector, threads: int) -> list[DetectedView]:
    """Return the views of a tour, aligned with the map; notes those that cannot be aligned."""
    views = []
    for frame, detection in tour.frames:
        view = view_from_detection(detection, frame, tour.regions)
        if view is not None:
            view = align_view(view, detector.gaussian_map, threads)
        if view is None:
            tour.skipped.append("a frame fits the map at another pose")
        else:
            views.append((view, detection))
    return views


def _confirm(
    changes: Sequence[Change], tour: Tour, views: Sequence[DetectedView]
) -> tuple[list[tuple[Change, tuple[Region, ...]]], list[tuple[Change, str]]]:
    """Return the confirmed changes with their regions, and the rejected ones with the reasons."""
    remaining = iter(tour.regions)
    confirmed: list[tuple[Change, tuple[Region, ...]]] = []
    rejected: list[tuple[Change, str]] = []
    for change in changes:
        regions = list(islice(remaining, len(regions_of(change))))
        result = confirm(change, regions, views, tour.skipped)
        if isinstance(result, str):
            rejected.append((change, result))
        else:
            sides = [region.side for region in regions_of(result)]
            own = tuple(region for region in regions if region.side in sides)
            confirmed.append((result, own))
    return confirmed, rejected
