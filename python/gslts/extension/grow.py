"""Growth of a map in memory: new space is fitted to the frames of a recording that show it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np

from gslts.change.visibility import Visibility
from gslts.core.camera import Camera
from gslts.core.gaussian_map import GaussianMap
from gslts.extension.constants import MIN_NEW_SHARE, MIN_SEEN, SEAM_SHARE
from gslts.extension.exposure import recording_exposure
from gslts.extension.fit import Patch, make_patch, merge_patch, replay_frames, without_changes
from gslts.extension.new_space import FrameSpace, KnownSpace
from gslts.mapping.clock import Clock
from gslts.mapping.config import MappingConfig
from gslts.mapping.density.control import max_weights
from gslts.mapping.engine import MIN_WEIGHT, ShowProgress, optimize
from gslts.mapping.evaluation.evaluate import evaluate, refine_pose
from gslts.mapping.frames import FrameSplit, split_held_out
from gslts.mapping.observation import Observation
from gslts.mapping.optimize import Optimizer, Schedule
from gslts.mapping.seeding.depth_seeds import NoSurfaceError
from gslts.rendering.losses import Exposure


@dataclass(frozen=True, eq=False)
class Growth:
    """A map that has grown.

    Attributes:
        gaussian_map: The map; new Gaussians have no features.
        split: Frames that tell the map something, at refined poses.
        refined: Number of old Gaussians that were refined.
        iterations: Optimization steps.
    """

    gaussian_map: GaussianMap
    split: FrameSplit
    refined: int
    iterations: int


def compare_frames(
    gaussian_map: GaussianMap,
    visibility: Visibility,
    frames: Mapping[str, Observation],
    threads: int = 0,
) -> dict[str, FrameSpace]:
    """Compare frames with what a map knows.

    Args:
        gaussian_map: float32.
        visibility: Of the training cameras of the map.
        frames: By name, at their poses in the map.
        threads: Number of threads; 0 means all.
    """
    known = KnownSpace(gaussian_map, visibility, threads)
    return {name: known.compare(frame.rgbd()) for name, frame in frames.items()}


def grow_map(
    gaussian_map: GaussianMap,
    cameras: Sequence[Camera],
    visibility: Visibility,
    frames: Mapping[str, Observation],
    spaces: Mapping[str, FrameSpace],
    config: MappingConfig,
    first_id: int,
    clock: Clock,
    report: ShowProgress,
) -> Growth | None:
    """Fit new space to frames; the result does not depend on the number of threads.

    Args:
        gaussian_map: float32.
        cameras: Training cameras of the map.
        visibility: Of these.
        frames: By name, at their poses in the map.
        spaces: What each of them shows.
        config: Settings of the mapping.
        first_id: Id of the first new Gaussian.
        clock: Notes the stages.
        report: Called after each step of the optimization.

    Returns:
        The map; None if no frame shows new space, or no surface there was measured by two frames.
    """
    if all(space.new.mean() < MIN_NEW_SHARE for space in spaces.values()):
        return None
    split, threads = _split(frames, spaces), config.threads
    training = list(split.training.values())
    shown = [spaces[name] for name in split.training]
    try:
        patch = make_patch(gaussian_map, training, shown, config, first_id)
    except NoSurfaceError:
        return None
    replays = replay_frames(gaussian_map, cameras, patch, threads)
    exposure = recording_exposure(
        gaussian_map, list(frames.values()), list(spaces.values()), threads
    )
    clock.note("seeding")
    config = _settings(config, len(training) + len(replays), len(cameras))
    optimizer = _fit(patch, replays, split, exposure, config, first_id, clock, report)
    fitted = _without_errors(optimizer, training, visibility, first_id)
    clock.note("optimization")
    return Growth(
        gaussian_map=merge_patch(gaussian_map, patch, fitted, first_id),
        split=split,
        refined=int((~patch.fixed & (patch.gaussian_map.ids < first_id)).sum()),
        iterations=optimizer.iteration,
    )


def measure_test_psnr_db(
    gaussian_map: GaussianMap, split: FrameSplit, threads: int = 0
) -> float | None:
    """Return the PSNR of the test frames at refined poses, dB; None without any.

    Args:
        gaussian_map: float32.
        split: Of the frames of the extension.
        threads: Number of threads; 0 means all.
    """
    starts = split.test.by_neighbours()
    if not starts:
        return None
    refined = [refine_pose(gaussian_map, frame, threads) for frame in starts]
    return evaluate(gaussian_map, refined, threads).psnr_db


def _split(frames: Mapping[str, Observation], spaces: Mapping[str, FrameSpace]) -> FrameSplit:
    """Split the frames that tell the map something; what changed since is masked out."""
    telling = {
        name: without_changes(frame, spaces[name])
        for name, frame in frames.items()
        if spaces[name].better.mean() >= MIN_NEW_SHARE
    }
    return FrameSplit.of(telling, split_held_out)


def _fit(
    patch: Patch,
    replays: Sequence[Observation],
    split: FrameSplit,
    exposure: Exposure,
    config: MappingConfig,
    first_id: int,
    clock: Clock,
    report: ShowProgress,
) -> Optimizer:
    """Fit the free Gaussians of a patch to the training frames and the replays.

    New ones are fitted alone at first, then together with the old ones at the seam.
    """
    training = [*split.training.values(), *replays]
    old = patch.gaussian_map.ids < first_id
    optimizer = Optimizer(
        patch.gaussian_map,
        training,
        training[0].lenses,
        config,
        Schedule(config.iterations, ((config.coarse_share, 1), (float("inf"), 0))),
        old,
        exposure,
    )
    fixed_ids = patch.gaussian_map.ids[patch.fixed]

    def free_seam() -> None:
        # As long as new walls are transparent, what is behind them would take their colours.
        if optimizer.share >= SEAM_SHARE:
            optimizer.fixed = np.isin(optimizer.adam.map.ids, fixed_ids)

    optimize(optimizer, split, [], clock, report, free_seam)
    return optimizer


def _settings(config: MappingConfig, frames: int, cameras: int) -> MappingConfig:
    """Return the settings of an extension: as many steps for each frame as a map of all has."""
    share = frames / max(1, frames + cameras)
    return config.model_copy(
        update={
            "iterations": math.ceil(share * config.iterations),
            "refine_lenses": False,
            "max_gaussians": None,
        }
    )


def _without_errors(
    optimizer: Optimizer, frames: Sequence[Observation], visibility: Visibility, first_id: int
) -> GaussianMap:
    """Return the Gaussians of a fit without new ones that no frame shows or that must be errors.

    Where training cameras of the map saw through from as near, there is no new surface.
    """
    gaussians, config = optimizer.adam.map, optimizer.config
    weights = max_weights(gaussians, optimizer.observations, config.threads)
    good = (weights > MIN_WEIGHT) | (gaussians.ids < first_id)
    new = np.flatnonzero(good & (gaussians.ids >= first_id))
    if visibility.has_cameras and len(new) > 0:
        points = gaussians.means[new].astype(np.float64) + gaussians.origin
        centres = (frame.world_from_camera[:3, 3] for frame in frames)
        near_m = reduce(np.minimum, (np.linalg.norm(points - c, axis=1) for c in centres))
        counts = visibility.counts(points, near_m)
        good[new] = counts.through < np.maximum(MIN_SEEN, counts.on)
    return gaussians.select(good)
