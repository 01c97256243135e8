"""Refinement of a pre-edited map, repeated until no change is detected any more.

Source: GS-LTS, sec. III-D, post-training. The repetition is ours.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from gslts.change.detector import ChangeDetector
from gslts.core.camera import Camera
from gslts.core.gaussian_map import GaussianMap
from gslts.types import Bools
from gslts.update.config import RefineConfig, UpdateConfig
from gslts.update.edit import Edit
from gslts.update.evidence import is_visible
from gslts.update.refine import OnStep, Refinement, refine
from gslts.update.region import Region
from gslts.update.targets import replay_targets, view_targets
from gslts.update.verify import remaining_confidence
from gslts.update.views import View, largest_range_m

MIN_VIEWS_BESIDE, FEW_VIEWS_REACH_M = 4, 0.1
"""Minimum number of views of a region, and the reach of its refinement with fewer, m. A few views
do not determine what they show from another side: centimetres of error of their poses would distort
it."""
RADIUS_SIGMAS = 2
"""Radius of a Gaussian, in its largest standard deviation."""
SETTLED_SHARE = 0.5
"""Maximum confidence of a change that may remain after the refinement, as a share of the confidence
at which a change is reported. A margin, because later frames have other noise."""
MAX_REPEATS = 2
"""Maximum number of repeated refinements; each one costs as much as the first."""


def refine_edit(
    before: GaussianMap,
    edit: Edit,
    active: Bools,
    cameras: Sequence[Camera],
    training: Sequence[View],
    regions: Sequence[Region],
    config: UpdateConfig,
    detector: ChangeDetector | None,
    on_step: OnStep,
) -> Refinement:
    """Refine an edited map until the detector sees no change in the training views.

    Args:
        before: Map before the edit.
        edit: Edited map.
        active: [N] bool, from `active_gaussians`.
        cameras: Training cameras of the map.
        training: Training views of the changes.
        regions: Regions of the changes.
        config: Settings.
        detector: Of the map before the edit; None means one refinement.
        on_step: Called after each step.

    Returns:
        The last refinement, with the iterations of all.
    """
    settings = config.refine
    targets = view_targets(training, regions, settings)
    targets += replay_targets(
        before,
        edit.gaussian_map,
        cameras,
        regions,
        settings,
        range_m=largest_range_m(training),
        threads=config.threads,
    )

    def refine_once(gaussian_map: GaussianMap) -> Refinement:
        return refine(
            gaussian_map, targets, active, settings, threads=config.threads, on_step=on_step
        )

    if detector is None:
        return refine_once(edit.gaussian_map)
    seen_from = [*cameras, *(view.camera for view in training)]
    frames = [view.frame for view in training]

    def confidence(gaussian_map: GaussianMap) -> float:
        return remaining_confidence(detector.with_map(gaussian_map, seen_from), frames, regions)

    settled = SETTLED_SHARE * detector.config.objects.min_confidence
    return refine_until_settled(edit.gaussian_map, refine_once, confidence, settled)


def refine_until_settled(
    edited: GaussianMap,
    refine_once: Callable[[GaussianMap], Refinement],
    confidence: Callable[[GaussianMap], float],
    settled: float,
) -> Refinement:
    """Refine a map, and repeat it while this reduces the confidence of a remaining change.

    Args:
        edited: Map after the pre-editing.
        refine_once: One refinement.
        confidence: Confidence with which a change is still seen in a map, 0 to 1.
        settled: Confidence at which the refinement is not repeated.

    Returns:
        The last refinement, with the iterations of all.
    """
    refined = refine_once(edited)
    remaining = confidence(refined.gaussian_map)
    for _ in range(MAX_REPEATS):
        if remaining <= settled:
            break
        more = refine_once(refined.gaussian_map)
        refined = replace(more, iterations=refined.iterations + more.iterations)
        previous, remaining = remaining, confidence(refined.gaussian_map)
        if remaining >= previous:  # More refinement does not help.
            break
    return refined


def is_shown_by_few(region: Region, views: Iterable[View]) -> bool:
    """Return whether too few views show a region to refine what stands beside it.

    Args:
        region: Of a change.
        views: All views of the changes.
    """
    return sum(is_visible(view.frame, region) for view in views) < MIN_VIEWS_BESIDE


def active_gaussians(
    edit: Edit, regions: Sequence[Region], views: Sequence[View], config: RefineConfig
) -> Bools:
    """Return the Gaussians that the refinement may change: new ones, and those near the regions.

    A Gaussian that reaches farther would also change where no view of the regions sees it.

    Args:
        edit: Edited map.
        regions: Regions of the changes.
        views: All views of the changes.
        config: Settings.

    Returns:
        [N] bool.
    """
    active = np.zeros(edit.gaussian_map.size, np.bool_)
    for region in regions:
        few = is_shown_by_few(region, views)
        reach_m = min(FEW_VIEWS_REACH_M, config.reach_m) if few else config.reach_m
        active |= near_regions(edit.gaussian_map, [region], reach_m)
    active[active.size - edit.added :] = True
    return active


def near_regions(gaussian_map: GaussianMap, regions: Sequence[Region], reach_m: float) -> Bools:
    """Return the Gaussians that lie near some regions as a whole.

    Args:
        gaussian_map: Any map.
        regions: Regions of changes.
        reach_m: Maximum distance from a region to the far side of a Gaussian, m.

    Returns:
        [N] bool.
    """
    centers = gaussian_map.means + gaussian_map.origin
    radii_m = RADIUS_SIGMAS * np.exp(gaussian_map.log_scales.max(axis=1))
    near = np.zeros(gaussian_map.size, np.bool_)
    for region in regions:
        near |= region.contains(centers, reach_m - radii_m[:, None])
    return near
