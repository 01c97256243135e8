"""The way from a data set to a map: read, seed, optimise, evaluate."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from gslts.camera import Camera
from gslts.datasets import Dataset, Frame
from gslts.frame import RgbdFrame
from gslts.gaussian_map import GaussianMap
from gslts.mapping.config import MappingConfig
from gslts.mapping.evaluate import Quality, evaluate
from gslts.mapping.optimize import Optimizer, Progress, TrainingFrame
from gslts.mapping.seed import seed_from_depth

HELD_OUT_EVERY = 8
"""Every eighth frame judges the map and is not learned from."""
MOST_BAD_SHARE = 0.2
"""With more unreadable frames, something is wrong with the data set and not with a frame."""

ShowFrames = Callable[[tuple[Frame, ...]], Iterable[Frame]]


@dataclass(frozen=True, eq=False)
class MappingResult:
    """A map, and what was found out on the way.

    Attributes:
        gaussian_map: float32.
        cameras: Corrected cameras of the frames learned from, by name.
        held_out: Quality on the frames that were kept aside.
        seeds: Gaussians at the start.
        skipped: Frames that could not be used, and why.
    """

    gaussian_map: GaussianMap
    cameras: dict[str, Camera]
    held_out: Quality
    seeds: int
    skipped: tuple[str, ...]


def make_map(
    dataset: Dataset,
    config: MappingConfig,
    *,
    show_frames: ShowFrames = iter,
    report: Callable[[Progress], None] = lambda _: None,
) -> MappingResult:
    """Makes a map of a data set with depth; the same for any number of threads.

    Args:
        dataset: At least nine frames, so that one can judge.
        config: Settings.
        show_frames: Shows how far the reading is.
        report: Is told after each step of the optimisation.

    Raises:
        ValueError: Too few frames can be read, or none has depth where another has.
    """
    frames, skipped = _read(dataset, show_frames)
    training = {name: frame for k, (name, frame) in enumerate(frames) if k % HELD_OUT_EVERY}
    held_out = [frame for _, frame in frames[::HELD_OUT_EVERY]]
    if len(training) < HELD_OUT_EVERY:
        raise ValueError(
            f"{dataset.name}: {len(frames)} frames are too few to make and judge a map"
        )
    seeds = seed_from_depth(training.values(), config.voxel_m, config.sh_degree)
    learned = [TrainingFrame.of(frame) for frame in training.values()]
    optimizer = Optimizer(seeds, learned, config)
    optimizer.run(report)
    gaussian_map = optimizer.adam.map
    return MappingResult(
        gaussian_map=gaussian_map,
        cameras={name: one.camera for name, one in zip(training, learned, strict=True)},
        held_out=evaluate(gaussian_map, held_out, config.threads),
        seeds=seeds.size,
        skipped=skipped,
    )


def _read(
    dataset: Dataset, show_frames: ShowFrames
) -> tuple[list[tuple[str, RgbdFrame]], tuple[str, ...]]:
    frames, bad = [], list(dataset.skipped)
    for frame in show_frames(dataset.frames):
        try:
            frames.append((frame.name, frame.read()))
        except (OSError, ValueError) as error:
            bad.append(f"{frame.name}: {error}")
    total = len(dataset.frames) + len(dataset.skipped)
    if len(bad) > MOST_BAD_SHARE * total:
        raise ValueError(
            f"{dataset.name}: {len(bad)} of {total} frames cannot be used, such as {bad[0]}"
        )
    return frames, tuple(bad)
