"""Whether an update made the map better, by views that it was not made from."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gslts._core.detect import confidence
from gslts.change.detector import ChangeDetector
from gslts.core.gaussian_map import GaussianMap
from gslts.rendering.losses import apply_exposure
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.update.refine import around
from gslts.update.region import NEAR_M, Region
from gslts.update.views import View

AROUND_PX = 20
"""Around the boxes of the change, where the map is compared with views held back."""


def split_held_back(views: Sequence[View], every: int) -> tuple[list[View], list[View]]:
    """Views to update with, and those to judge by: of each `every` the middle one.

    Args:
        views: In the order in which they were taken.
        every: At least 2. Of fewer views, the last but one is held back.
    """
    chosen = {k for k in range(len(views)) if k % every == every // 2}
    if not chosen and len(views) > 1:
        chosen = {len(views) - 2}
    used = [view for k, view in enumerate(views) if k not in chosen]
    return used, [view for k, view in enumerate(views) if k in chosen]


def error_around(
    gaussian_map: GaussianMap, views: Sequence[View], regions: Sequence[Region], threads: int = 0
) -> float | None:
    """Mean squared error of the colours around a change, 0 to 1; None where no view shows it.

    Args:
        gaussian_map: float32.
        views: Of the change.
        regions: Where it is.
        threads: 0 means one a hardware thread.
    """
    rasterizer, options = Rasterizer(np.float32), RenderOptions(threads=threads)
    total, count = 0.0, 0
    for view in views:
        mask = around(view, regions, AROUND_PX)
        images = rasterizer.forward(gaussian_map, view.camera, options, mask=mask)
        photo = view.frame.rgb[mask].astype(np.float32) / np.float32(255)
        shown = apply_exposure(images.rgb[mask], view.exposure).clip(0, 1)
        total += float(np.sum((shown - photo) ** 2, dtype=np.float64))
        count += photo.size
    return total / count if count else None


def doubt_left(detector: ChangeDetector, views: Sequence[View], regions: Sequence[Region]) -> float:
    """The greatest certainty with which a detector sees a change at some regions in any view.

    Args:
        detector: Of the updated map.
        views: Of the changes.
        regions: Where they were.

    Returns:
        0 to 1; likely changes count as well as unlikely ones, which the detector does not report.
    """
    found = [
        confidence(surface)
        for view in views
        for surface in detector.detect(view.frame).surfaces
        if any(region.contains(surface.point, NEAR_M) for region in regions)
    ]
    return max(found, default=0.0)
