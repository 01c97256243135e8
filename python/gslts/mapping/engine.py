"""The way from a data set to a map: read, find poses and lenses, seed, optimise, judge."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from gslts.datasets import Dataset, Frame
from gslts.gaussian_map import GaussianMap
from gslts.mapping.config import MappingConfig
from gslts.mapping.evaluate import HeldOut, evaluate, evaluate_held_out, near_by
from gslts.mapping.lenses import Lenses
from gslts.mapping.observation import LEVELS, Observation
from gslts.mapping.optimize import Optimizer, Progress, Schedule
from gslts.mapping.report_data import CurvePoint
from gslts.mapping.seed import seed_from_depth

HELD_OUT_EVERY = 8
"""Every eighth frame judges the map and is not learned from."""
MOST_BAD_SHARE = 0.2
"""With more unreadable frames, something is wrong with the data set and not with a frame."""
ROUGH_WIDTH_PX = 160
"""Rough poses are found in images of at least this width."""
ROUGH_BUDGET = 0.2
"""Share of the time that is left which rough poses may take."""
JUDGED_TIMES = 20
"""How often in the course of the optimisation the frames kept aside are looked at."""

ShowFrames = Callable[[Sequence[Frame]], Iterable[Frame]]
ShowProgress = Callable[[Progress], None]


@dataclass(frozen=True, eq=False)
class MappingResult:
    """A map, and what was found out on the way.

    Attributes:
        gaussian_map: float32.
        training: The frames learned from, by name.
        held_out: Those kept aside, by name, at refined poses.
        quality: Judged by those.
        given_lenses: Of the data set.
        curve: Of the optimisation.
        seeds: Gaussians at its start.
        seconds: By stage.
        skipped: Frames that could not be used, and why.
    """

    gaussian_map: GaussianMap
    training: dict[str, Observation]
    held_out: dict[str, Observation]
    quality: HeldOut
    given_lenses: Lenses
    curve: tuple[CurvePoint, ...]
    seeds: int
    seconds: dict[str, float]
    skipped: tuple[str, ...]


def make_map(
    dataset: Dataset,
    config: MappingConfig,
    *,
    show_frames: ShowFrames = iter,
    report: ShowProgress = lambda _: None,
) -> MappingResult:
    """Makes a map of a data set with depth; the same for any number of threads.

    Args:
        dataset: At least nine frames, so that one can judge.
        config: Settings.
        show_frames: Shows how far the reading is.
        report: Is told after each step of the optimisation.

    Raises:
        ValueError: Too few frames can be read, or no surface was measured by two of them.
    """
    clock = _Clock(config.budget_s)
    frames, skipped = _read(dataset, show_frames)
    names = list(frames)
    training = {name: frames[name] for k, name in enumerate(names) if k % HELD_OUT_EVERY}
    held_out = {name: frames[name] for name in names[::HELD_OUT_EVERY]}
    if len(training) < HELD_OUT_EVERY:
        raise ValueError(
            f"{dataset.name}: {len(frames)} frames are too few to make and judge a map"
        )
    observations = list(training.values())
    given = observations[0].lenses
    if not all(one.lenses.alike(given) for one in frames.values()):
        # Each sensor would have to be corrected by itself, from a part of the frames.
        config = config.model_copy(update={"refine_lenses": False})
    clock.note("reading")
    if config.refine_poses and config.rough_epochs > 0:
        _find_rough_poses(observations, given, config, clock)
        clock.note("rough poses")
    seeds = seed_from_depth(
        (one.rgbd() for one in observations), config.voxel_m, config.seed_contrast, config.sh_degree
    )
    clock.note("seeding")
    levels = ((config.coarse_share, 1), (float("inf"), 0))
    schedule = Schedule(config.iterations, levels, clock.deadline_s)
    optimizer = Optimizer(seeds, observations, given, config, schedule)
    neighbours = [
        [frames[names[near]] for near in (k - 1, k + 1) if 0 <= near < len(names)]
        for k in range(0, len(names), HELD_OUT_EVERY)
    ]
    curve: list[CurvePoint] = []
    while optimizer.share < 1:
        psnrs_db: list[float] = []

        def watch(progress: Progress, psnrs_db: list[float] = psnrs_db) -> None:
            psnrs_db.append(progress.psnr_db)
            report(progress)

        optimizer.run_epoch(watch)
        held_out_db = None
        if optimizer.share >= sum(p.held_out_psnr_db is not None for p in curve) / JUDGED_TIMES:
            if config.refine_lenses:
                _follow(held_out.values(), observations[0].lenses)
            near = [near_by(*pair) for pair in zip(held_out.values(), neighbours, strict=True)]
            held_out_db = evaluate(optimizer.adam.map, near, config.threads, level=1).psnr_db
        curve.append(
            CurvePoint(
                seconds=clock.seconds(),
                iteration=optimizer.iteration,
                training_psnr_db=sum(psnrs_db) / max(1, len(psnrs_db)),
                held_out_psnr_db=held_out_db,
                gaussians=optimizer.adam.map.size,
            )
        )
    clock.note("optimising")
    gaussian_map = optimizer.adam.map
    if config.refine_lenses:
        _follow(held_out.values(), observations[0].lenses)
    quality, refined = evaluate_held_out(
        gaussian_map, list(held_out.values()), neighbours, config.threads
    )
    clock.note("judging")
    return MappingResult(
        gaussian_map=gaussian_map,
        training=training,
        held_out=dict(zip(held_out, refined, strict=True)),
        quality=quality,
        given_lenses=given,
        curve=tuple(curve),
        seeds=seeds.size,
        seconds=clock.stages,
        skipped=skipped,
    )


def _find_rough_poses(
    observations: list[Observation], given: Lenses, config: MappingConfig, clock: _Clock
) -> None:
    """Corrects poses and lenses with a coarse map, so that the seeds of the fine one are sharp."""
    level = 0
    while level + 1 < LEVELS and given.color.width >> (level + 1) >= ROUGH_WIDTH_PX:
        level += 1
    seeds = seed_from_depth(
        (one.rgbd() for one in observations), 2 * config.voxel_m, config.seed_contrast
    )
    iterations = config.rough_epochs * len(observations)
    schedule = Schedule(iterations, ((float("inf"), level),), clock.deadline_of(ROUGH_BUDGET))
    optimizer = Optimizer(seeds, observations, given, config, schedule)
    while optimizer.share < 1:
        optimizer.run_epoch(lambda _: None)


def _follow(held_out: Iterable[Observation], lenses: Lenses) -> None:
    """Gives frames of the same sensor its corrected lenses."""
    for one in held_out:
        one.set_lenses(lenses)


def _read(
    dataset: Dataset, show_frames: ShowFrames
) -> tuple[dict[str, Observation], tuple[str, ...]]:
    frames: dict[str, Observation] = {}
    bad = list(dataset.skipped)
    for frame in show_frames(dataset.frames):
        try:
            frames[frame.name] = Observation.of(frame.read())
        except (OSError, ValueError) as error:
            bad.append(f"{frame.name}: {error}")
    total = len(dataset.frames) + len(dataset.skipped)
    if len(bad) > MOST_BAD_SHARE * total:
        raise ValueError(
            f"{dataset.name}: {len(bad)} of {total} frames cannot be used, such as {bad[0]}"
        )
    return frames, tuple(bad)


class _Clock:
    """How long stages take, and when the budget ends."""

    def __init__(self, budget_s: float | None) -> None:
        self._start_s = self._last_s = time.monotonic()
        self.deadline_s = None if budget_s is None else self._start_s + budget_s
        self.stages: dict[str, float] = {}

    def note(self, stage: str) -> None:
        now_s = time.monotonic()
        self.stages[stage] = now_s - self._last_s
        self._last_s = now_s

    def seconds(self) -> float:
        return time.monotonic() - self._start_s

    def deadline_of(self, share: float) -> float | None:
        """When a share of the time that is left will be over."""
        if self.deadline_s is None:
            return None
        now_s = time.monotonic()
        return now_s + share * max(0.0, self.deadline_s - now_s)
