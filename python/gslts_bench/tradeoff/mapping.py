"""Accuracy of maps of one data set against time and number of Gaussians, by test frames.

Against time, a map is made from scratch for each budget, as a schedule that is cut short is worse
than one of that length. Against their number, the Gaussians of a finished map are reduced or split,
and all are refined for the same number of steps.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import isfinite
from typing import Any

import numpy as np

from gslts.core.gaussian_map import GaussianMap
from gslts.datasets import Dataset
from gslts.mapping.config import MappingConfig
from gslts.mapping.density.control import split as split_gaussians
from gslts.mapping.engine import make_map
from gslts.mapping.evaluation.evaluate import HeldOutQuality, evaluate_held_out
from gslts.mapping.evaluation.held_out import TrainingRecord
from gslts.mapping.evaluation.variants import merge_to, refine_map
from gslts.mapping.frames import FrameSplit, HeldOutFrames, ShowFrames
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
        given_psnr_db, by_neighbours_psnr_db, refined_psnr_db: PSNR of test frames at the three
            poses of `gslts.mapping.evaluation.evaluate.HeldOutQuality`.
    """

    kind: str
    name: str
    seconds: float | None
    steps: int | None
    gaussians: int
    given_psnr_db: float
    by_neighbours_psnr_db: float | None
    refined_psnr_db: float


def split_of(
    dataset: Dataset, record: TrainingRecord, show_frames: ShowFrames = iter
) -> FrameSplit:
    """Read the frames of a data set and split them as when a map was made.

    Args:
        dataset: The data set of the map.
        record: Record of the map.
        show_frames: Wraps the frames to show progress.

    Raises:
        ValueError: There are too few frames, or no test frame.
    """
    split = FrameSplit.read(dataset, record.observe, record.split, show_frames)
    test = split.test.observations
    if not test:
        raise ValueError(
            f"{dataset.name}: there is no test frame: the map was made from all of its frames"
        )
    if not record.cameras:  # Without refined poses, neighbours do not tell a correction.
        split = replace(split, test=HeldOutFrames(test, [[] for _ in test]))
    return split


def mean_opacity(gaussian_map: GaussianMap, split: FrameSplit, threads: int) -> float:
    """Return the mean opacity of a map in the frames that it was made from, 0 to 1.

    Args:
        gaussian_map: The map, float32.
        split: Frames of the data set.
        threads: 0 means one per hardware thread.
    """
    rasterizer, options = Rasterizer(np.float32), RenderOptions(threads=threads)
    coarse = (frame.camera(LEVELS - 1) for frame in split.training.values())
    images = (rasterizer.forward(gaussian_map, camera, options) for camera in coarse)
    return float(np.mean([image.alpha.mean() for image in images]))


def measure_map(
    gaussian_map: GaussianMap, split: FrameSplit, seconds: float | None, threads: int
) -> MappingPoint:
    """Measure the map as it is.

    Args:
        gaussian_map: The map, float32.
        split: Frames of the data set.
        seconds: Time in which it was made, s; None if unknown.
        threads: 0 means one per hardware thread.
    """
    quality = _evaluate(gaussian_map, split, threads)
    return _point("map", "the map", seconds, None, gaussian_map.size, quality)


def measure_count(
    gaussian_map: GaussianMap, split: FrameSplit, config: MappingConfig, name: str
) -> MappingPoint:
    """Measure the map with a share of its Gaussians, refined.

    Args:
        gaussian_map: A finished map, float32.
        split: Frames of the data set that it was made from.
        config: Rates and losses of the refinement.
        name: The share, of `COUNTS`.
    """
    training, share = list(split.training.values()), COUNTS[name]
    steps = max(MIN_STEPS, MIN_VISITS * len(training))
    if not split.has_depth:
        config = config.for_photographs(split.extent_m)
    config = config.model_copy(update={"variant_steps": steps})
    if share > 1:
        start = split_gaussians(gaussian_map, np.arange(gaussian_map.size))
    else:
        count = max(1, int(share * gaussian_map.size))
        start = merge_to(gaussian_map, count, training, config.threads)
    finished = refine_map(start, training, config)
    quality = _evaluate(finished, split, config.threads)
    return _point("gaussians", name, None, steps, finished.size, quality)


def measure_budget(dataset: Dataset, config: MappingConfig, budget_s: float) -> MappingPoint:
    """Make a map from scratch with a schedule of the length of a budget, and measure it.

    Args:
        dataset: The data set.
        config: Settings of the mapping.
        budget_s: The budget.

    Raises:
        ValueError: No map can be made of the data set, see `make_map`, or it has too few frames to
            hold out any.
    """
    result = make_map(dataset, config.model_copy(update={"budget_s": budget_s, "variant_steps": 0}))
    if result.quality is None:
        raise ValueError(f"{dataset.name}: {len(result.training)} frames are too few to test")
    steps = result.curve[-1].iteration if result.curve else 0
    size = result.gaussian_map.size
    return _point("time", f"{budget_s:g} s", result.used_s, steps, size, result.quality)


def seconds_of(manifest: Mapping[str, Any]) -> float | None:
    """Return the time in which a map was made, by its manifest; None if that does not say.

    Args:
        manifest: Manifest of the map.
    """
    stages = manifest.get("seconds")
    if not isinstance(stages, dict):
        return None
    seconds = [s for stage, s in stages.items() if stage != "evaluation"]
    if not all(isinstance(s, int | float) and isfinite(s) and s >= 0 for s in seconds):
        return None
    return float(sum(seconds)) or None


def _evaluate(gaussian_map: GaussianMap, split: FrameSplit, threads: int) -> HeldOutQuality:
    return evaluate_held_out(gaussian_map, split.test, threads)[0]


def _point(
    kind: str,
    name: str,
    seconds: float | None,
    steps: int | None,
    gaussians: int,
    quality: HeldOutQuality,
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
