"""What time and Gaussians buy: the accuracy of maps of one data set, by test frames.

Against time, a map is made afresh for each budget, because a schedule that is cut short shows less
than one of that length. Against their number, the Gaussians of a finished map are made fewer or
more, and all are refined for as many steps.
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
from gslts.mapping.density.control import split as split_gaussians
from gslts.mapping.engine import make_map
from gslts.mapping.evaluation.evaluate import HeldOutQuality, evaluate_held_out
from gslts.mapping.evaluation.held_out import TrainingRecord
from gslts.mapping.evaluation.variants import merge_to, refine_map
from gslts.mapping.frames import FrameSplit, HeldOutFrames, ShowFrames
from gslts.mapping.observation import LEVELS
from gslts.rendering.rasterizer import Rasterizer, RenderOptions

COUNTS = {"an eighth": 0.125, "a quarter": 0.25, "half": 0.5, "as many": 1.0, "double": 2.0}
"""Numbers of Gaussians that are tried, as shares of those of the map."""
LEAST_STEPS, LEAST_VISITS = 300, 2
"""Maps of other sizes are refined for so many steps, and until each frame was seen so often."""
LEAST_COVERED = 0.5
"""A map that fills less of the frames is of another place, or in another world frame."""


@dataclass(frozen=True)
class MappingPoint:
    """How good one map is, and what it took.

    Attributes:
        kind: "map" for the map itself, "gaussians" for one refined with more or fewer of them,
            "time" for one made afresh.
        name: "the map", what share of its Gaussians (of `COUNTS`), or the budget ("10 s").
        seconds: For reading, seeding and optimising; None if the map does not tell or was refined
            from another one.
        steps: Of its optimisation or refinement; None if the map does not tell.
        gaussians: How many it has.
        given_psnr_db, by_neighbours_psnr_db, refined_psnr_db: Of the test frames, at the
            three choices of poses of `gslts.mapping.evaluation.evaluate.HeldOutQuality`.
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
        dataset: Data set of the map.
        record: Record of the map.
        show_frames: Shows the progress of reading.

    Raises:
        ValueError: There are too few frames, or no test frame.
    """
    split = FrameSplit.read(dataset, record.observe, record.split, show_frames)
    test = split.test.observations
    if not test:
        raise ValueError(
            f"{dataset.name}: there is no test frame: the map was made from all frames"
        )
    if not record.cameras:  # Without refined poses, neighbours do not tell a correction.
        split = replace(split, test=HeldOutFrames(test, [[] for _ in test]))
    return split


def covered(gaussian_map: GaussianMap, split: FrameSplit, threads: int) -> float:
    """The mean opacity of a map in the frames that it was made from, 0 to 1."""
    rasterizer, options = Rasterizer(np.float32), RenderOptions(threads=threads)
    coarse = (one.camera(LEVELS - 1) for one in split.training.values())
    images = (rasterizer.forward(gaussian_map, camera, options) for camera in coarse)
    return float(np.mean([image.alpha.mean() for image in images]))


def itself(
    gaussian_map: GaussianMap, split: FrameSplit, seconds: float | None, threads: int
) -> MappingPoint:
    """The map as it is."""
    quality = _judged(gaussian_map, split, threads)
    return _point("map", "the map", seconds, None, gaussian_map.size, quality)


def against_count(
    gaussian_map: GaussianMap, split: FrameSplit, config: MappingConfig
) -> Iterator[MappingPoint]:
    """An eighth, a quarter, half, as many and double as many Gaussians, refined alike.

    Args:
        gaussian_map: A finished map, float32.
        split: Frames of the data set that it was made from.
        config: Rates and losses of the refinement.
    """
    training = list(split.training.values())
    steps = max(LEAST_STEPS, LEAST_VISITS * len(training))
    if not split.has_depth:
        config = config.for_photographs(split.extent_m)
    config = config.model_copy(update={"variant_steps": steps})
    for name, share in COUNTS.items():
        if share > 1:
            start = split_gaussians(gaussian_map, np.arange(gaussian_map.size))
        else:
            count = max(1, int(share * gaussian_map.size))
            start = merge_to(gaussian_map, count, training, config.threads)
        finished = refine_map(start, training, config)
        quality = _judged(finished, split, config.threads)
        yield _point("gaussians", name, None, steps, finished.size, quality)


def against_time(
    dataset: Dataset, config: MappingConfig, budgets_s: Iterable[float]
) -> Iterator[MappingPoint]:
    """Maps made afresh, each with a whole schedule of that length.

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
    """How long a map was made, as its folder tells; None if it does not."""
    stages = manifest.get("seconds")
    if not isinstance(stages, dict):
        return None
    seconds = [s for stage, s in stages.items() if stage != "evaluation"]
    if not all(isinstance(s, int | float) and isfinite(s) and s >= 0 for s in seconds):
        return None
    return float(sum(seconds)) or None


def _judged(gaussian_map: GaussianMap, split: FrameSplit, threads: int) -> HeldOutQuality:
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
