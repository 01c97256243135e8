"""The way from a data set to a map: read, find poses and lenses, seed, optimise, judge."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from gslts.core.gaussian_map import GaussianMap
from gslts.datasets import Dataset
from gslts.mapping.checkpoint import Checkpoint
from gslts.mapping.clock import Clock
from gslts.mapping.config import MappingConfig
from gslts.mapping.density.control import greatest_weights
from gslts.mapping.evaluation.evaluate import (
    HeldOut,
    evaluate,
    evaluate_held_out,
    near_by,
    refine_pose,
)
from gslts.mapping.evaluation.variants import Variant, chosen_of, variants_of
from gslts.mapping.frames import ShowFrames, Visit, every_eighth
from gslts.mapping.initialize import Start, start_of
from gslts.mapping.lenses import Lenses
from gslts.mapping.observation import Observation
from gslts.mapping.optimize import Optimizer, Progress, Schedule
from gslts.mapping.report.data import CurvePoint

JUDGED_TIMES = 20
"""How often in the course of the optimisation the frames kept aside are looked at."""
LEAST_GAIN_DB = 0.02
"""What frames kept aside must gain, or the optimisation ends; see `MappingConfig.patience`."""
SAVE_EVERY_S = 20.0
"""So much work is lost at most if the machine stops."""
NOISE = 0.02
"""Of a camera's colours, of 1: a Gaussian that never has a greater share in a pixel goes."""

ShowProgress = Callable[[Progress], None]


@dataclass(frozen=True, eq=False)
class MappingResult:
    """A map, and what was found out on the way.

    Attributes:
        config: What it was made with: the settings that fit these frames.
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

    config: MappingConfig
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

    @property
    def used_s(self) -> float:
        """Seconds that making it took, without the judging."""
        return sum(seconds for stage, seconds in self.seconds.items() if stage != "judging")


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
        dataset: At least ten frames, two of which judge.
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
    visit = Visit.of(dataset, lambda frame: Observation.of(frame.read()), every_eighth, show_frames)
    observations = list(visit.training.values())
    given = observations[0].lenses
    config = _fitting(config, visit, given)
    clock.note("reading")
    if resume is None:
        start, curve = start_of(dataset, observations, config, clock), []
    else:
        start, curve = _resumed(resume, dataset, visit, config), list(resume.curve)
    optimizer = _optimizer(start, observations, given, config, clock)
    if resume is not None:
        resume.restore_optimizer(optimizer)
    while optimizer.share < 1 and not _settled(curve, config.patience):
        curve.append(_epoch(optimizer, visit, curve, clock, report))
        if save is not None and clock.since_saved_s() > SAVE_EVERY_S:
            stages = clock.with_current("optimising")
            names = (*visit.training, *visit.held_out)
            save(Checkpoint.of(optimizer, config, names, tuple(curve), start.seeds, stages))
            clock.saved()
    gaussian_map = optimizer.adam.map
    weights = greatest_weights(gaussian_map, observations, config.threads)
    gaussian_map = gaussian_map.select(weights > NOISE)
    clock.note("optimising")
    variants: list[Variant] = []
    if config.variant_steps > 0:
        near = _near(visit)
        fitted = [refine_pose(gaussian_map, one, config.threads) for one in near]
        variants = variants_of(gaussian_map, observations, fitted, config)
        gaussian_map = chosen_of(variants).gaussian_map
        clock.note("comparing sizes")
    quality, refined = evaluate_held_out(
        gaussian_map, list(visit.held_out.values()), visit.neighbours, config.threads
    )
    clock.note("judging")
    return MappingResult(
        config=config,
        gaussian_map=gaussian_map,
        training=dict(visit.training),
        held_out=dict(zip(visit.held_out, refined, strict=True)),
        quality=quality,
        given_lenses=given,
        curve=tuple(curve),
        variants=tuple(variants),
        seeds=start.seeds,
        seconds=clock.stages,
        skipped=visit.skipped,
    )


def _fitting(config: MappingConfig, visit: Visit, given: Lenses) -> MappingConfig:
    """Only what can be found out from these frames."""
    frames = [*visit.training.values(), *visit.held_out.values()]
    if not all(one.lenses.alike(given) for one in frames):
        # Each sensor would have to be corrected by itself, from a part of the frames.
        config = config.model_copy(update={"refine_lenses": False})
    return config if visit.has_depth else config.for_photographs(visit.extent_m)


def _resumed(resume: Checkpoint, dataset: Dataset, visit: Visit, config: MappingConfig) -> Start:
    same_frames = resume.frames == (*visit.training, *visit.held_out)
    if not same_frames or not resume.config.same_map(config):
        what = "settings" if same_frames else "frames"
        raise ValueError(f"{dataset.name}: the checkpoint is of other {what}")
    resume.restore_observations(list(visit.training.values()))
    if config.refine_lenses:
        _follow(visit.held_out.values(), resume.lenses)
    return Start(resume.gaussian_map, resume.seeds, resume.pose_stds)


def _optimizer(
    start: Start,
    observations: Sequence[Observation],
    given: Lenses,
    config: MappingConfig,
    clock: Clock,
) -> Optimizer:
    levels = ((config.coarse_share, 1), (float("inf"), 0))
    schedule = Schedule(config.iterations, levels, clock.times_s("optimising"))
    found = {"pose_std_m": start.pose_stds[0], "pose_std_rad": start.pose_stds[1]}
    config = config.model_copy(update=found)
    return Optimizer(start.gaussian_map, observations, given, config, schedule)


def _epoch(
    optimizer: Optimizer,
    visit: Visit,
    curve: Sequence[CurvePoint],
    clock: Clock,
    report: ShowProgress,
) -> CurvePoint:
    psnrs_db: list[float] = []

    def watch(progress: Progress) -> None:
        psnrs_db.append(progress.psnr_db)
        report(progress)

    optimizer.run_epoch(watch)
    config = optimizer.config
    if config.refine_lenses:
        _follow(visit.held_out.values(), optimizer.observations[0].lenses)
    held_out_db = None
    if optimizer.share >= sum(p.held_out_psnr_db is not None for p in curve) / JUDGED_TIMES:
        held_out_db = evaluate(optimizer.adam.map, _near(visit), config.threads, level=1).psnr_db
    return CurvePoint(
        seconds=clock.seconds(),
        iteration=optimizer.iteration,
        level=optimizer.schedule.level(optimizer.share),
        training_psnr_db=sum(psnrs_db) / max(1, len(psnrs_db)),
        held_out_psnr_db=held_out_db,
        gaussians=optimizer.adam.map.size,
    )


def _settled(curve: Sequence[CurvePoint], patience: float) -> bool:
    """Whether frames kept aside no longer gain, at the full resolution."""
    looks = max(1, round(patience * JUDGED_TIMES))
    looks_db = [
        p.held_out_psnr_db for p in curve if p.level == 0 and p.held_out_psnr_db is not None
    ]
    if len(looks_db) <= looks:
        return False
    return max(looks_db[-looks:]) < max(looks_db[:-looks]) + LEAST_GAIN_DB


def _near(visit: Visit) -> list[Observation]:
    """Frames kept aside, where their neighbours say that they were taken."""
    return [near_by(*pair) for pair in zip(visit.held_out.values(), visit.neighbours, strict=True)]


def _follow(held_out: Iterable[Observation], lenses: Lenses) -> None:
    """Gives frames of the same sensor its corrected lenses."""
    for one in held_out:
        one.set_lenses(lenses)
