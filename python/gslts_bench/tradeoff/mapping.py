"""Accuracy of maps of one data set against time and number of Gaussians, by held-out frames.

Against time, a map is made from scratch for each budget, as a schedule that is cut short is worse
than one of that length. Against their number, the Gaussians of a finished map are reduced or split,
and all are refined for the same number of steps.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from math import isfinite
from typing import Any

import numpy as np

from gslts.core.gaussian_map import GaussianMap
from gslts.datasets import Dataset
from gslts.mapping.config import MappingConfig
from gslts.mapping.density.control import split
from gslts.mapping.engine import make_map
from gslts.mapping.evaluation.evaluate import HeldOut, evaluate_held_out
from gslts.mapping.evaluation.held_out import Known, judging
from gslts.mapping.evaluation.variants import fewer, refined
from gslts.mapping.frames import ShowFrames, Visit
from gslts.mapping.observation import LEVELS
from gslts.rendering.rasterizer import Rasterizer, RenderOptions

COUNTS = {"an eighth": 0.125, "a quarter": 0.25, "half": 0.5, "as many": 1.0, "double": 2.0}
"""Numbers of Gaussians that are compared, as shares of those of the map."""
MIN_STEPS, MIN_VISITS = 300, 2
"""Minimum number of refinement steps of other sizes, in all and per frame."""
MIN_OPACITY = 0.5
"""Minimum mean opacity in the frames; below, map and data set are of different rooms or worlds."""


@dataclass(frozen=True)
class MappingPoint:
    """Accuracy and cost of one map.

    Attributes:
        kind: "map" for the map itself, "gaussians" for one refined with more or fewer of them,
            "time" for one made from scratch.
        name: "the map", the share of its Gaussians (of `COUNTS`), or the budget ("10 s").
        seconds: Time of reading, seeding and optimization; None if unknown or refined from another
            map.
        steps: Steps of its optimization or refinement; None if unknown.
        gaussians: Number of Gaussians.
        given_psnr_db, by_neighbours_psnr_db, refined_psnr_db: PSNR of held-out frames at the three
            poses of `gslts.mapping.evaluation.evaluate.HeldOut`.
    """

    kind: str
    name: str
    seconds: float | None
    steps: int | None
    gaussians: int
    given_psnr_db: float
    by_neighbours_psnr_db: float | None
    refined_psnr_db: float


def visit_of(dataset: Dataset, known: Known, show_frames: ShowFrames = iter) -> Visit:
    """Read the frames of a data set with the cameras that a map knows.

    Args:
        dataset: The data set of the map.
        known: Cameras of the map.
        show_frames: Wraps the frames to show progress.

    Raises:
        ValueError: There are too few frames, or none is held out of the map.
    """
    visit = Visit.of(dataset, known.observe, lambda names: judging(names, known), show_frames)
    if not visit.held_out:
        raise ValueError(f"{dataset.name}: the map was made from all of its frames")
    if not known.cameras:  # Nothing was corrected that neighbours could tell of.
        visit = replace(visit, neighbours=[[] for _ in visit.held_out])
    return visit


def mean_opacity(gaussian_map: GaussianMap, visit: Visit, threads: int) -> float:
    """Return the mean opacity of a map in the frames that it was made from, 0 to 1."""
    rasterizer, options = Rasterizer(np.float32), RenderOptions(threads=threads)
    coarse = (frame.camera(LEVELS - 1) for frame in visit.training.values())
    images = (rasterizer.forward(gaussian_map, camera, options) for camera in coarse)
    return float(np.mean([image.alpha.mean() for image in images]))


def measure_map(
    gaussian_map: GaussianMap, visit: Visit, seconds: float | None, threads: int
) -> MappingPoint:
    """Measure the map as it is."""
    quality = _evaluate(gaussian_map, visit, threads)
    return _point("map", "the map", seconds, None, gaussian_map.size, quality)


def measure_counts(
    gaussian_map: GaussianMap, visit: Visit, config: MappingConfig
) -> Iterator[MappingPoint]:
    """Measure the map with each share of `COUNTS` of its Gaussians, refined alike.

    Args:
        gaussian_map: A finished map, float32.
        visit: Frames of the data set that it was made from.
        config: Rates and losses of the refinement.
    """
    training = list(visit.training.values())
    steps = max(MIN_STEPS, MIN_VISITS * len(training))
    if not visit.has_depth:
        config = config.for_photographs(visit.extent_m)
    config = config.model_copy(update={"variant_steps": steps})
    for name, share in COUNTS.items():
        if share > 1:
            start = split(gaussian_map, np.arange(gaussian_map.size))
        else:
            count = max(1, int(share * gaussian_map.size))
            start = fewer(gaussian_map, count, training, config.threads)
        finished = refined(start, training, config)
        quality = _evaluate(finished, visit, config.threads)
        yield _point("gaussians", name, None, steps, finished.size, quality)


def measure_budgets(
    dataset: Dataset, config: MappingConfig, budgets_s: Iterable[float]
) -> Iterator[MappingPoint]:
    """Make a map from scratch for each budget, with a schedule of that length, and measure it.

    Args:
        dataset: The data set.
        config: Settings of the mapping.
        budgets_s: Budgets.

    Raises:
        ValueError: No map can be made of the data set; see `make_map`.
    """
    for budget_s in budgets_s:
        update = {"budget_s": budget_s, "variant_steps": 0}
        result = make_map(dataset, config.model_copy(update=update))
        steps = result.curve[-1].iteration if result.curve else 0
        size = result.gaussian_map.size
        yield _point("time", f"{budget_s:g} s", result.used_s, steps, size, result.quality)


def seconds_of(manifest: Mapping[str, Any]) -> float | None:
    """Return the time in which a map was made, by its manifest; None if that does not say."""
    stages = manifest.get("seconds")
    if not isinstance(stages, dict):
        return None
    seconds = [s for stage, s in stages.items() if stage != "judging"]
    if not all(isinstance(s, int | float) and isfinite(s) and s >= 0 for s in seconds):
        return None
    return float(sum(seconds)) or None


def _evaluate(gaussian_map: GaussianMap, visit: Visit, threads: int) -> HeldOut:
    held_out = list(visit.held_out.values())
    return evaluate_held_out(gaussian_map, held_out, visit.neighbours, threads)[0]


def _point(
    kind: str,
    name: str,
    seconds: float | None,
    steps: int | None,
    gaussians: int,
    quality: HeldOut,
) -> MappingPoint:
    by_neighbours = quality.by_neighbours
    return MappingPoint(
        kind=kind,
        name=name,
        seconds=seconds,
        steps=steps,
        gaussians=gaussians,
        given_psnr_db=quality.given.psnr_db,
        by_neighbours_psnr_db=None if by_neighbours is None else by_neighbours.psnr_db,
        refined_psnr_db=quality.refined.psnr_db,
    )
