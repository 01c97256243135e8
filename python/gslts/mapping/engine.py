"""Mapping engine: from a data set to a map, in the stages read, initialize, optimize, evaluate.

Training frames make the map. Validation frames end the optimization early and choose the degree of
the spherical harmonics. The quality that is reported is that of the test frames alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from gslts.core.gaussian_map import GaussianMap
from gslts.datasets import Dataset
from gslts.mapping.checkpoint import Checkpoint
from gslts.mapping.clock import Clock
from gslts.mapping.config import MappingConfig
from gslts.mapping.density.control import max_weights
from gslts.mapping.evaluation.evaluate import (
    HeldOutQuality,
    evaluate,
    evaluate_held_out,
    refine_pose,
)
from gslts.mapping.evaluation.variants import Variant, choose_variant, make_variants
from gslts.mapping.frames import FrameSplit, ShowFrames, observe, split_held_out
from gslts.mapping.initialize import Start, initialize
from gslts.mapping.lenses import Lenses
from gslts.mapping.observation import Observation
from gslts.mapping.optimize import Optimizer, Progress, Schedule
from gslts.mapping.order import sort_by_place
from gslts.mapping.report.data import CurvePoint

VALIDATIONS = 20
"""Number of validations in the course of the optimization. Each costs one rendering per validation
frame at half resolution; more would end the optimization more exactly."""
MIN_GAIN_DB = 0.02
"""Validation PSNR that must be gained for the optimization to go on; see `MappingConfig.patience`.
Repeated validations of a converged map differ by less."""
SAVE_EVERY_S = 20.0
"""Minimum interval of checkpoints, s. The first is made after initialization, the others after
epochs: a crash loses this and an epoch, or the time until the first Gaussians are seeded."""
MIN_WEIGHT = 0.02
"""Gaussians whose blending weight is lower in every pixel of all training frames are pruned: they
change colours by less than the noise of a camera."""

TRAINING_FRAMES = 50
"""Maximum number of training frames, evenly chosen, that the finished map is compared with, at half
resolution: each takes 20 ms for 100,000 Gaussians."""

ShowProgress = Callable[[Progress], None]


@dataclass(frozen=True, eq=False)
class MappingResult:
    """A map, and the record of how it was made.

    Attributes:
        config: Settings as adapted to the data set.
        gaussian_map: float32.
        training: Training frames by name, at refined poses.
        held_out: Validation and test frames by name, at poses refined against the map.
        validation: Names of the frames that ended the optimization and chose the variant.
        test: Names of the frames that `quality` is measured on.
        quality: Quality on the test frames; None without any.
        training_psnrs_db: PSNR of at most `TRAINING_FRAMES` training frames by name, at half
            resolution, dB.
        given_lenses: Lenses by the data set.
        curve: One point per epoch of the optimization.
        variants: The map itself, with other numbers of Gaussians and of the next SH degree.
        seeds: Number of Gaussians at the start.
        seconds: Time by stage, s.
        skipped: Frames that could not be used, and why.
    """

    config: MappingConfig
    gaussian_map: GaussianMap
    training: dict[str, Observation]
    held_out: dict[str, Observation]
    validation: tuple[str, ...]
    test: tuple[str, ...]
    quality: HeldOutQuality | None
    training_psnrs_db: dict[str, float]
    given_lenses: Lenses
    curve: tuple[CurvePoint, ...]
    variants: tuple[Variant, ...]
    seeds: int
    seconds: dict[str, float]
    skipped: tuple[str, ...]

    @property
    def used_s(self) -> float:
        """Time without the evaluation, s."""
        return sum(seconds for stage, seconds in self.seconds.items() if stage != "evaluation")


def make_map(
    dataset: Dataset,
    config: MappingConfig,
    *,
    resume: Checkpoint | None = None,
    save: Callable[[Checkpoint], None] | None = None,
    show_frames: ShowFrames = iter,
    report: ShowProgress = lambda _: None,
) -> MappingResult:
    """Make a map of a data set; bit-identical for any number of threads.

    Of ten frames or more, every 8th is held out from training: alternately for test and for
    validation. Fewer are all training frames: then neither the lenses nor the number of Gaussians
    are chosen by the frames, and the quality is not measured.

    Args:
        dataset: At least four frames.
        config: Settings.
        resume: Checkpoint of an interrupted run of the same data set; without a time budget, the
            map becomes what it would have become.
        save: Called with a checkpoint after initialization and epochs, at most every
            `SAVE_EVERY_S`.
        show_frames: Shows the progress of reading.
        report: Called after each step of the optimization.

    Raises:
        ValueError: Too few frames can be read, no surface was measured by two of them, or the
            checkpoint is of another data set or of other settings.
    """
    clock = Clock(config.budget_s, {} if resume is None else resume.seconds)
    split = FrameSplit.read(dataset, observe, split_held_out, show_frames)
    observations = list(split.training.values())
    given = observations[0].lenses
    config = _adapt(config, split, given)
    clock.note("reading")
    if resume is None:
        start, curve = initialize(dataset, observations, config, clock), []
    else:
        start, curve = _resume(resume, dataset, split, config), list(resume.curve)
    optimizer = _optimizer(start, observations, given, config, clock)
    if resume is not None:
        resume.restore_optimizer(optimizer)

    def save_sometimes() -> None:
        if save is not None and clock.since_checkpoint_s() > SAVE_EVERY_S:
            stages = clock.with_current("optimization")
            save(Checkpoint.of(optimizer, config, split.names, tuple(curve), start.seeds, stages))
            clock.note_checkpoint()

    if resume is None:
        save_sometimes()
    optimize(optimizer, split, curve, clock, report, save_sometimes)
    gaussian_map = optimizer.adam.map
    weights = max_weights(gaussian_map, observations, config.threads)
    gaussian_map = sort_by_place(gaussian_map.select(weights > MIN_WEIGHT))
    clock.note("optimization")
    return _evaluate(gaussian_map, config, split, given, curve, start.seeds, clock)


def optimize(
    optimizer: Optimizer,
    split: FrameSplit,
    curve: list[CurvePoint],
    clock: Clock,
    report: ShowProgress,
    on_epoch: Callable[[], None] = lambda: None,
) -> None:
    """Run epochs to the end of the schedule, or until the validation PSNR stops rising.

    Args:
        optimizer: Of the training frames.
        split: All frames.
        curve: Gets a point per epoch; not empty if a run is resumed.
        clock: Of the run.
        report: Called after each step.
        on_epoch: Called after each epoch.
    """
    while optimizer.share < 1 and not has_converged(curve, optimizer.config.patience):
        curve.append(_run_epoch(optimizer, split, curve, clock, report))
        on_epoch()


def _evaluate(
    gaussian_map: GaussianMap,
    config: MappingConfig,
    split: FrameSplit,
    given: Lenses,
    curve: Sequence[CurvePoint],
    seeds: int,
    clock: Clock,
) -> MappingResult:
    """Choose the variant by the validation frames, and measure the quality on the test frames."""
    variants: list[Variant] = []
    if config.variant_steps > 0:
        validation = _refine_validation(gaussian_map, split, config)
        observations = list(split.training.values())
        variants = make_variants(gaussian_map, observations, list(validation.values()), config)
        gaussian_map = choose_variant(variants).gaussian_map
        clock.note("variants")
    quality, test = None, dict[str, Observation]()
    if split.test.observations:
        quality, test = evaluate_held_out(gaussian_map, split.test, config.threads)
    refined = {**test, **_refine_validation(gaussian_map, split, config)}
    training_psnrs_db = _training_psnrs_db(gaussian_map, split.training, config.threads)
    clock.note("evaluation")
    return MappingResult(
        config=config,
        gaussian_map=gaussian_map,
        training=dict(split.training),
        held_out={name: refined[name] for name in split.names if name in refined},
        validation=tuple(split.validation.observations),
        test=tuple(test),
        quality=quality,
        training_psnrs_db=training_psnrs_db,
        given_lenses=given,
        curve=tuple(curve),
        variants=tuple(variants),
        seeds=seeds,
        seconds=clock.stages,
        skipped=split.skipped,
    )


def _training_psnrs_db(
    gaussian_map: GaussianMap, training: Mapping[str, Observation], threads: int
) -> dict[str, float]:
    names = list(training)
    chosen = np.linspace(0, len(names) - 1, min(len(names), TRAINING_FRAMES)).round().astype(int)
    return {
        names[k]: evaluate(gaussian_map, [training[names[k]]], threads, level=1).psnr_db
        for k in chosen
    }


def _refine_validation(
    gaussian_map: GaussianMap, split: FrameSplit, config: MappingConfig
) -> dict[str, Observation]:
    starts = split.validation.by_neighbours()
    refined = [refine_pose(gaussian_map, frame, config.threads) for frame in starts]
    return dict(zip(split.validation.observations, refined, strict=True))


def _adapt(config: MappingConfig, split: FrameSplit, given: Lenses) -> MappingConfig:
    """Turn off what these frames do not determine."""
    frames = [*split.training.values(), *split.held_out]
    if not all(frame.lenses.is_close(given) for frame in frames):
        # Each sensor would have to be refined by itself, from a part of the frames.
        config = config.model_copy(update={"refine_lenses": False})
    if not config.refine_poses:  # Lenses are found from the normal equations of the poses.
        config = config.model_copy(update={"refine_lenses": False})
    if not split.validation.observations:
        config = config.model_copy(update={"refine_lenses": False, "variant_steps": 0})
    return config if split.has_depth else config.for_photographs(split.extent_m)


def _resume(
    resume: Checkpoint, dataset: Dataset, split: FrameSplit, config: MappingConfig
) -> Start:
    same_frames = resume.frames == split.names
    if not same_frames or not resume.config.same_map(config):
        what = "settings" if same_frames else "frames"
        raise ValueError(f"{dataset.name}: the checkpoint is of other {what}")
    resume.restore_observations(list(split.training.values()))
    if config.refine_lenses:
        _set_lenses(split.held_out, resume.lenses)
    return Start(resume.gaussian_map, resume.seeds, resume.pose_stds)


def _optimizer(
    start: Start,
    observations: Sequence[Observation],
    given: Lenses,
    config: MappingConfig,
    clock: Clock,
) -> Optimizer:
    levels = ((config.coarse_share, 1), (float("inf"), 0))
    schedule = Schedule(config.iterations, levels, clock.times_s("optimization"))
    found = {"pose_std_m": start.pose_stds[0], "pose_std_rad": start.pose_stds[1]}
    config = config.model_copy(update=found)
    return Optimizer(start.gaussian_map, observations, given, config, schedule)


def _run_epoch(
    optimizer: Optimizer,
    split: FrameSplit,
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
        _set_lenses(split.held_out, optimizer.observations[0].lenses)
    validation_db = None
    frames = split.validation.by_neighbours()
    validations = sum(point.validation_psnr_db is not None for point in curve)
    if frames and optimizer.share >= validations / VALIDATIONS:
        validation_db = evaluate(optimizer.adam.map, frames, config.threads, level=1).psnr_db
    return CurvePoint(
        seconds=clock.seconds(),
        iteration=optimizer.iteration,
        level=optimizer.schedule.level(optimizer.share),
        training_psnr_db=sum(psnrs_db) / max(1, len(psnrs_db)),
        validation_psnr_db=validation_db,
        gaussians=optimizer.adam.map.size,
    )


def has_converged(curve: Sequence[CurvePoint], patience: float) -> bool:
    """Return whether the validation PSNR stopped rising at full resolution.

    Args:
        curve: Points of the optimization so far.
        patience: Share of the schedule in which it must rise by `MIN_GAIN_DB`.
    """
    count = max(1, round(patience * VALIDATIONS))
    psnrs_db = [
        p.validation_psnr_db for p in curve if p.level == 0 and p.validation_psnr_db is not None
    ]
    if len(psnrs_db) <= count:
        return False
    return max(psnrs_db[-count:]) < max(psnrs_db[:-count]) + MIN_GAIN_DB


def _set_lenses(frames: Iterable[Observation], lenses: Lenses) -> None:
    for frame in frames:
        frame.set_lenses(lenses)
