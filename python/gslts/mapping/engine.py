"""The way from a data set to a map: read, find poses and lenses, seed, optimise, judge."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from gslts.datasets import Dataset, Frame
from gslts.gaussian_map import GaussianMap
from gslts.mapping.checkpoint import Checkpoint
from gslts.mapping.clock import Clock
from gslts.mapping.config import MappingConfig
from gslts.mapping.density import greatest_weights
from gslts.mapping.evaluate import HeldOut, evaluate, evaluate_held_out, near_by, refine_pose
from gslts.mapping.lenses import Lenses
from gslts.mapping.observation import LEVELS, Observation
from gslts.mapping.optimize import Optimizer, Progress, Schedule
from gslts.mapping.pose import twist_of
from gslts.mapping.report_data import CurvePoint
from gslts.mapping.seed import seed_from_depth
from gslts.mapping.seed_points import random_points_in_view, seed_from_points
from gslts.mapping.triangulate import triangulated
from gslts.mapping.variants import Variant, chosen_of, variants_of

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

SAVE_EVERY_S = 20.0
"""So much work is lost at most if the machine stops."""

NOISE = 0.02
"""Of a camera's colours, of 1: a Gaussian that never has a greater share in a pixel goes."""
AVERAGED = 12.0
"""So many more facts about the map are the poses of frames whose errors are their own."""
LEAST_POINTS, RANDOM_POINTS = 100, 30_000
"""With fewer points, photographs without depth start from so many random ones."""
LEAST_POSE_STD_M, LEAST_POSE_STD_RAD = 0.001, 0.0005
"""No pose is better known than this."""

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
        variants: The map and others, such as with half as many Gaussians.
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
    variants: tuple[Variant, ...]
    seeds: int
    seconds: dict[str, float]
    skipped: tuple[str, ...]


def make_map(
    dataset: Dataset,
    config: MappingConfig,
    *,
    resume: Checkpoint | None = None,
    save: Callable[[Checkpoint], None] | None = None,
    show_frames: ShowFrames = iter,
    report: ShowProgress = lambda _: None,
) -> MappingResult:
    """Makes a map of a data set; the same for any number of threads.

    Args:
        dataset: At least nine frames, so that one can judge.
        config: Settings.
        resume: Where an earlier run of the same data set stopped; without a budget in seconds, the
            map becomes what it would have become.
        save: Is given a checkpoint now and then.
        show_frames: Shows how far the reading is.
        report: Is told after each step of the optimisation.

    Raises:
        ValueError: Too few frames can be read, no surface was measured by two of them, or the
            checkpoint is not of this data set or not of these settings.
    """
    clock = Clock(config.budget_s, {} if resume is None else resume.seconds)
    frames, skipped = _read(dataset, show_frames)
    names = tuple(frames)
    training = {name: frames[name] for k, name in enumerate(names) if k % HELD_OUT_EVERY}
    held_out = {name: frames[name] for name in names[::HELD_OUT_EVERY]}
    if len(training) < HELD_OUT_EVERY:
        raise ValueError(
            f"{dataset.name}: {len(frames)} frames are too few to make and judge a map"
        )
    neighbours = [
        [frames[names[near]] for near in (k - 1, k + 1) if 0 <= near < len(names)]
        for k in range(0, len(names), HELD_OUT_EVERY)
    ]
    observations = list(training.values())
    given = observations[0].lenses
    if not all(one.lenses.alike(given) for one in frames.values()):
        # Each sensor would have to be corrected by itself, from a part of the frames.
        config = config.model_copy(update={"refine_lenses": False})
    has_depth = any(one.measured[0].any() for one in observations)
    if not has_depth:
        config = config.for_photographs()
    clock.note("reading")
    if resume is None:
        if config.refine_poses and config.rough_epochs > 0:
            _find_rough_poses(observations, given, config, clock)
            clock.note("rough poses")
        start = _first_gaussians(dataset, observations, config)
        seeds = start.size
        pose_stds = _pose_stds(observations, config)
        clock.note("seeding")
    else:
        if resume.frames != names or not resume.config.same_map(config):
            what = "settings" if resume.frames == names else "frames"
            raise ValueError(f"{dataset.name}: the checkpoint is of other {what}")
        start, seeds, pose_stds = resume.gaussian_map, resume.seeds, resume.pose_stds
        resume.restore_observations(observations)
    levels = ((config.coarse_share, 1), (float("inf"), 0))
    schedule = Schedule(config.iterations, levels, clock.times_s("optimising"))
    found = {"pose_std_m": pose_stds[0], "pose_std_rad": pose_stds[1]}
    optimizer = Optimizer(start, observations, given, config.model_copy(update=found), schedule)
    if resume is not None:
        resume.restore_optimizer(optimizer)
    curve: list[CurvePoint] = [] if resume is None else list(resume.curve)
    while optimizer.share < 1:
        psnrs_db: list[float] = []

        def watch(progress: Progress, psnrs_db: list[float] = psnrs_db) -> None:
            psnrs_db.append(progress.psnr_db)
            report(progress)

        optimizer.run_epoch(watch)
        if config.refine_lenses:
            _follow(held_out.values(), observations[0].lenses)
        held_out_db = None
        if optimizer.share >= sum(p.held_out_psnr_db is not None for p in curve) / JUDGED_TIMES:
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
        if save is not None and clock.since_saved_s() > SAVE_EVERY_S:
            stages = clock.with_current("optimising")
            save(Checkpoint.of(optimizer, config, names, tuple(curve), seeds, stages))
            clock.saved()
    near = [near_by(*pair) for pair in zip(held_out.values(), neighbours, strict=True)]
    gaussian_map, variants = optimizer.adam.map, []
    weights = greatest_weights(gaussian_map, observations, config.threads)
    gaussian_map = gaussian_map.select(weights > NOISE)
    clock.note("optimising")
    if config.variant_steps > 0:
        fitted = [refine_pose(gaussian_map, one, config.threads) for one in near]
        variants = variants_of(gaussian_map, observations, fitted, config)
        gaussian_map = chosen_of(variants).gaussian_map
        clock.note("comparing sizes")
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
        variants=tuple(variants),
        seeds=seeds,
        seconds=clock.stages,
        skipped=skipped,
    )


def _first_gaussians(
    dataset: Dataset, observations: list[Observation], config: MappingConfig
) -> GaussianMap:
    """From depth; else from points of the data set, triangulated ones, or random ones."""
    frames = [one.rgbd() for one in observations]
    if any(one.measured[0].any() for one in observations):
        return seed_from_depth(
            frames,
            config.voxel_m,
            config.seed_contrast,
            sh_degree=config.sh_degree,
            most=config.max_gaussians,
        )
    cloud = triangulated(frames) if dataset.points is None else dataset.points
    if len(cloud.points) < LEAST_POINTS:
        cloud = random_points_in_view(frames, RANDOM_POINTS, config.seed)
    return seed_from_points(cloud, frames, config.sh_degree)


def _find_rough_poses(
    observations: list[Observation], given: Lenses, config: MappingConfig, clock: Clock
) -> None:
    """Corrects poses and lenses with a coarse map, so that the seeds of the fine one are sharp."""
    level = 0
    while level + 1 < LEVELS and given.color.width >> (level + 1) >= ROUGH_WIDTH_PX:
        level += 1
    seeds = seed_from_depth(
        (one.rgbd() for one in observations), 2 * config.voxel_m, config.seed_contrast
    )
    iterations = config.rough_epochs * len(observations)
    times_s = clock.times_s("rough poses", ROUGH_BUDGET)
    schedule = Schedule(iterations, ((float("inf"), level),), times_s)
    optimizer = Optimizer(seeds, observations, given, config, schedule)
    while optimizer.share < 1:
        optimizer.run_epoch(lambda _: None)


def _pose_stds(observations: list[Observation], config: MappingConfig) -> tuple[float, float]:
    """How far given poses are off, m and rad, as far as the rough ones tell.

    Errors of their own of many frames average out in the map, so that given poses are worth more
    together than alone; errors that neighbours share, as of a drift, do not.
    """
    twists = np.array([twist_of(one.correction) for one in observations])
    stds = []
    for part in np.split(twists, 2, axis=1):
        squares = (part**2).sum(axis=1)
        shared = (part[1:] * part[:-1]).sum() / max(float(squares.sum()), 1e-12)
        own = 1 - float(np.clip(shared, 0, 1))
        stds.append(float(np.sqrt(squares.mean() / 3 / (1 + AVERAGED * own))))
    return (
        min(max(stds[0], LEAST_POSE_STD_M), config.pose_std_m),
        min(max(stds[1], LEAST_POSE_STD_RAD), config.pose_std_rad),
    )


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
            if frame.name in frames:
                raise ValueError("there is another frame of that name")
            frames[frame.name] = Observation.of(frame.read())
        except (OSError, ValueError) as error:
            bad.append(f"{frame.name}: {error}")
    total = len(dataset.frames) + len(dataset.skipped)
    if len(bad) > MOST_BAD_SHARE * total:
        raise ValueError(
            f"{dataset.name}: {len(bad)} of {total} frames cannot be used, such as {bad[0]}"
        )
    return frames, tuple(bad)
