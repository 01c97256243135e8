"""Refinement of the Gaussians around past changes by frames of the present state."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gslts.consolidation.constants import EPOCHS, MARGIN_PX, REACH_M
from gslts.core.gaussian_map import GaussianMap
from gslts.mapping.config import PRESETS
from gslts.mapping.evaluation.evaluate import evaluate, refine_pose
from gslts.mapping.frames import HeldOutFrames
from gslts.mapping.observation import Observation
from gslts.mapping.optimize import Optimizer, Progress, Schedule
from gslts.rendering.rasterizer import RenderOptions, rows_in_view
from gslts.rendering.view_range import MIN_RANGE_M, view_range_m
from gslts.update.region import Region
from gslts.update.settle import near_regions
from gslts.update.targets import region_mask


@dataclass(frozen=True, eq=False)
class Fit:
    """A part of a map before and after the refinement.

    Attributes:
        before: Gaussians that the frames may show.
        after: The same, without those that became transparent.
        refined: Number of Gaussians that were free.
        iterations: Number of steps.
    """

    before: GaussianMap
    after: GaussianMap
    refined: int
    iterations: int


def refine_regions(
    gaussian_map: GaussianMap,
    frames: Sequence[Observation],
    regions: Sequence[Region],
    threads: int = 0,
    on_step: Callable[[Progress], None] = lambda _: None,
) -> Fit:
    """Fit the Gaussians near some regions to frames; all others stay as they are, bit by bit.

    No Gaussian is added. The result does not depend on the number of threads.

    Args:
        gaussian_map: float32.
        frames: Training frames, aligned with the map; their exposures are fitted in place.
        regions: Boxes of what changed.
        threads: 0 uses all hardware threads.
        on_step: Called after each step.
    """
    range_m = max([MIN_RANGE_M, *(view_range_m(frame.depth()) for frame in frames)])
    cameras = [frame.camera() for frame in frames]
    before = gaussian_map.select(
        rows_in_view(gaussian_map, cameras, RenderOptions(far_m=range_m, threads=threads))
    )
    free = near_regions(before, regions, REACH_M)
    settings = {
        "refine_poses": False,
        "refine_lenses": False,
        "fill_holes": False,
        "growth": 0.0,
        "coarse_share": 0.0,
        "threads": threads,
    }
    iterations = EPOCHS * len(frames)
    optimizer = Optimizer(
        replace(before, features=np.zeros((before.size, 0), np.float32)),
        frames,
        frames[0].lenses,
        PRESETS["fast"].model_copy(update=settings),
        Schedule(iterations, ((float("inf"), 0),)),
        ~free,
    )
    while optimizer.share < 1:
        optimizer.run_epoch(on_step)
    fitted = optimizer.adam.map
    features = before.features[np.searchsorted(before.ids, fitted.ids)]
    return Fit(before, replace(fitted, features=features), int(free.sum()), iterations)


def region_psnr_db(
    gaussian_map: GaussianMap, frames: HeldOutFrames, regions: Sequence[Region], threads: int = 0
) -> float | None:
    """Compute the PSNR of held-out frames around some regions, at poses refined with the map.

    Args:
        gaussian_map: float32.
        frames: Held-out frames at their poses in the map.
        regions: Boxes of what changed.
        threads: 0 uses all hardware threads.

    Returns:
        Mean over the frames, dB; None if none shows a region.
    """
    shown = []
    for frame in frames.observations.values():
        near = region_mask(frame.camera(), regions, MARGIN_PX)
        if np.any(frame.with_mask(near).mask()):
            shown.append(refine_pose(gaussian_map, frame, threads).with_mask(near))
    return evaluate(gaussian_map, shown, threads).psnr_db if shown else None
