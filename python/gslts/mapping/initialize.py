"""Where the optimisation starts: rough poses, the trust in given ones, the first Gaussians."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from gslts.core.camera import shift_origin
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.core.se3 import twist_of
from gslts.datasets import Dataset, PointCloud
from gslts.mapping.clock import Clock
from gslts.mapping.config import MappingConfig
from gslts.mapping.observation import LEVELS, Observation
from gslts.mapping.optimize import Optimizer, Schedule
from gslts.mapping.seeding.depth_seeds import seed_from_depth
from gslts.mapping.seeding.point_seeds import random_points_in_view, seed_from_points
from gslts.mapping.seeding.triangulate import triangulated
from gslts.types import Floats

ROUGH_WIDTH_PX = 160
"""Rough poses are found in images of at least this width."""
ROUGH_BUDGET = 0.2
"""Share of the time that is left which rough poses may take."""
AVERAGED = 12.0
"""So many more facts about the map are the poses of frames whose errors are their own."""
LEAST_POINTS, RANDOM_POINTS = 100, 30_000
"""With fewer points, photographs without depth start from so many random ones."""
FAR_M = 1000.0
"""Maps of cameras that are farther from the world's origin get one of their own: float32 resolves
0.1 mm there."""
LEAST_POSE_STD_M, LEAST_POSE_STD_RAD = 0.001, 0.0005
"""No pose is better known than this."""


@dataclass(frozen=True, eq=False)
class Start:
    """What the optimisation starts from.

    Attributes:
        gaussian_map: float32.
        seeds: Gaussians at the very start.
        pose_stds: How far given poses are off, m and rad.
    """

    gaussian_map: GaussianMap
    seeds: int
    pose_stds: tuple[float, float]


def start_of(
    dataset: Dataset, observations: Sequence[Observation], config: MappingConfig, clock: Clock
) -> Start:
    """Corrects poses and lenses roughly, and seeds Gaussians where surfaces were measured.

    Args:
        dataset: Its points are taken if it has no depth; else they are triangulated, or random.
        observations: Frames to learn from; those of one sensor share their lenses.
        config: Settings.
        clock: Is told how long it took.

    Raises:
        ValueError: No surface was measured by two frames.
    """
    if config.refine_poses and config.rough_epochs > 0:
        _find_rough_poses(observations, config, clock)
        clock.note("rough poses")
    start = _first_gaussians(dataset, observations, config)
    clock.note("seeding")
    return Start(start, start.size, _pose_stds(observations, config))


def _first_gaussians(
    dataset: Dataset, observations: Sequence[Observation], config: MappingConfig
) -> GaussianMap:
    origin = _origin(observations)
    frames = _frames(observations, origin)
    if any(one.measured[0].any() for one in observations):
        seeds = seed_from_depth(
            frames,
            config.voxel_m,
            config.seed_contrast,
            sh_degree=config.sh_degree,
            most=config.max_gaussians,
        )
        return replace(seeds, origin=origin)
    if dataset.points is None:
        cloud = triangulated(frames)
    else:
        cloud = PointCloud(dataset.points.points - origin, dataset.points.colors)
    if len(cloud.points) < LEAST_POINTS:
        cloud = random_points_in_view(frames, RANDOM_POINTS, config.seed)
    seeds = seed_from_points(cloud, frames, config.sh_degree, config.max_gaussians)
    return replace(seeds, origin=origin)


def _origin(observations: Sequence[Observation]) -> Floats:
    """(3,) m of the map: the world's, or whole metres in the middle of cameras far from that."""
    middle = np.mean([one.given_pose[:3, 3] for one in observations], axis=0)
    return np.rint(middle) if np.linalg.norm(middle) > FAR_M else np.zeros(3)


def _frames(observations: Sequence[Observation], origin: Floats) -> list[RgbdFrame]:
    """In a frame that starts there."""
    frames = (one.rgbd() for one in observations)
    return [replace(frame, camera=shift_origin(frame.camera, origin)) for frame in frames]


def _find_rough_poses(
    observations: Sequence[Observation], config: MappingConfig, clock: Clock
) -> None:
    """Corrects poses and lenses with a coarse map, so that the seeds of the fine one are sharp."""
    given = observations[0].lenses
    level = 0
    while level + 1 < LEVELS and given.color.width >> (level + 1) >= ROUGH_WIDTH_PX:
        level += 1
    origin = _origin(observations)
    frames = _frames(observations, origin)
    seeds = seed_from_depth(frames, 2 * config.voxel_m, config.seed_contrast)
    seeds = replace(seeds, origin=origin)
    iterations = config.rough_epochs * len(observations)
    times_s = clock.times_s("rough poses", ROUGH_BUDGET)
    schedule = Schedule(iterations, ((float("inf"), level),), times_s)
    rough = config.model_copy(update={"growth": 0.0})
    optimizer = Optimizer(seeds, observations, given, rough, schedule)
    while optimizer.share < 1:
        optimizer.run_epoch(lambda _: None)


def _pose_stds(observations: Sequence[Observation], config: MappingConfig) -> tuple[float, float]:
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
