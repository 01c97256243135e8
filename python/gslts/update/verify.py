"""Verification of an update by views that were held out of it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from gslts._core.detect import confidence
from gslts.change.detector import ChangeDetector
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.rendering.losses import apply_exposure
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.rendering.view_range import view_range_m
from gslts.update.evidence import is_visible
from gslts.update.region import MAX_REGION_DISTANCE_M, Region
from gslts.update.targets import region_pixels
from gslts.update.views import View

MARGIN_PX = 20
"""Margin around the regions in which the map is compared with validation views, px."""


def split_views(
    views: Sequence[View], regions_by_change: Sequence[Sequence[Region]], every: int
) -> tuple[list[View], list[View]]:
    """Split views into training and validation views, so that each change has some of both.

    Args:
        views: In the order in which they were taken.
        regions_by_change: Regions of each change.
        every: At least 2; the middle one of each `every` views is a validation view, and the last
            but one of the views of a change that has none.

    Returns:
        Training views, and validation views.
    """
    rows = {row for row in range(len(views)) if row % every == every // 2}
    shown_by_change = [
        [row for row, view in enumerate(views) if any(is_visible(view.frame, r) for r in regions)]
        for regions in regions_by_change
    ]
    for shown in shown_by_change:
        if len(shown) > 1 and not rows.intersection(shown):
            rows.add(shown[-2])
    for shown in shown_by_change:
        if len(shown) > 1 and rows.issuperset(shown):
            rows.remove(shown[-1])
    training = [view for row, view in enumerate(views) if row not in rows]
    return training, [view for row, view in enumerate(views) if row in rows]


def error_in_regions(
    gaussian_map: GaussianMap, views: Sequence[View], regions: Sequence[Region], threads: int = 0
) -> float | None:
    """Compute the mean squared error of the colours around some regions.

    Args:
        gaussian_map: float32.
        views: Validation views.
        regions: Regions of the changes.
        threads: 0 uses all hardware threads.

    Returns:
        Error of sRGB colours, 0 to 1; None if no view shows a region.
    """
    rasterizer, gaussian_map = Rasterizer(np.float32), gaussian_map.without_features()
    total, count = 0.0, 0
    for view in views:
        mask = region_pixels(view, regions, MARGIN_PX)
        options = RenderOptions(far_m=view_range_m(view.depth), threads=threads)
        images = rasterizer.forward(gaussian_map, view.camera, options, mask=mask)
        observed = view.frame.rgb[mask].astype(np.float32) / np.float32(255)
        rendered = apply_exposure(images.rgb[mask], view.exposure).clip(0, 1)
        total += float(np.sum((rendered - observed) ** 2, dtype=np.float64))
        count += observed.size
    return total / count if count else None


def remaining_confidence(
    detector: ChangeDetector, frames: Iterable[RgbdFrame], regions: Sequence[Region]
) -> float:
    """Return the highest confidence with which a detector still sees a change in some regions.

    Args:
        detector: Of the map.
        frames: Of the changes.
        regions: Regions of the changes.

    Returns:
        0 to 1, also of changes that are too unlikely to be reported.
    """
    found = [
        confidence(surface)
        for frame in frames
        for surface in detector.detect(frame).surfaces
        if any(region.contains(surface.point, MAX_REGION_DISTANCE_M) for region in regions)
    ]
    return max(found, default=0.0)
