"""Initialization of the optimization: rough poses, their uncertainty, and the first Gaussians."""

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
from gslts.mapping.seeding.triangulate import triangulate
from gslts.types import Floats

ROUGH_WIDTH_PX = 160
"""Minimum width of the images in which rough poses are found, px: the coarsest level that is not
narrower is used."""
ROUGH_BUDGET_SHARE = 0.2
"""Share of the remaining time budget that rough poses may take."""
AVERAGED_FRAMES = 12.0
"""Number of frames over which independent pose errors average out in the map: the weight of given
poses grows by it where neighbouring errors are uncorrelated."""
MIN_POINTS, RANDOM_POINTS = 100, 30_000
"""Minimum number of triangulated points of images without depth, and number of random points that
replace them otherwise."""
FAR_M = 1000.0
"""Distance of the cameras from the world's origin, m, beyond which a map gets an origin of its own:
float32 resolves 0.1 mm there."""
MIN_POSE_STD_M, MIN_POSE_STD_RAD = 0.001, 0.0005
"""Minimum standard deviation of given poses, m and rad: keeps the prior finite for exact poses."""
ROUNDING = 1e-6
"""Corrections below it, m and rad, are no refinement: the first epoch refines no pose, but moves
them to where they were, with errors of rounding."""


@dataclass(frozen=True, eq=False)
class Start:
    """Initial state of the optimization.

    Attributes:
        gaussian_map: float32.
        seeds: Number of its Gaussians; a checkpoint keeps it while the map grows.
        pose_stds: Standard deviations of the given poses, m and rad.
    """

    gaussian_map: GaussianMap
    seeds: int
    pose_stds: tuple[float, float]


def initialize(
    dataset: Dataset, observations: Sequence[Observation], config: MappingConfig, clock: Clock
) -> Start:
    """Refine poses and lenses roughly, and seed Gaussians on measured surfaces.

    Without depth, Gaussians are seeded at the points of the data set, or at triangulated or random
    points.

    Args:
        dataset: Data set of the frames.
        observations: Training frames; poses and lenses are refined in place.
        config: Settings.
        clock: Notes the stages.

    Raises:
        ValueError: No surface was measured by two frames.
    """
    if config.refine_poses and config.rough_epochs > 0:
        _refine_roughly(observations, config, clock)
        clock.note("rough poses")
    start = _first_gaussians(dataset, observations, config)
    clock.note("seeding")
    return Start(start, start.size, _pose_stds(observations, config))


def _first_gaussians(
    dataset: Dataset, observations: Sequence[Observation], config: MappingConfig
) -> GaussianMap:
    origin = _origin(observations)
    frames = _frames(observations, origin)
    if any(observation.has_depth for observation in observations):
        seeds = seed_from_depth(
            frames,
            config.voxel_m,
            config.seed_contrast,
            sh_degree=config.sh_degree,
            max_gaussians=config.max_gaussians,
        )
        return replace(seeds, origin=origin)
    if dataset.points is None:
        cloud = triangulate(frames)
    else:
        cloud = PointCloud(dataset.points.points - origin, dataset.points.colors)
    if len(cloud.points) < MIN_POINTS:
        cloud = random_points_in_view(frames, RANDOM_POINTS, config.seed)
    seeds = seed_from_points(cloud, frames, config.sh_degree, config.max_gaussians)
    return replace(seeds, origin=origin)


def _origin(observations: Sequence[Observation]) -> Floats:
    """Return the origin (3,) of the map, m: the world's, or whole metres amid far cameras."""
    middle = np.mean([frame.given_pose[:3, 3] for frame in observations], axis=0)
    return np.rint(middle) if np.linalg.norm(middle) > FAR_M else np.zeros(3)


def _frames(observations: Sequence[Observation], origin: Floats) -> list[RgbdFrame]:
    """Return the frames in the frame of the map's origin."""
    frames = (observation.rgbd() for observation in observations)
    return [replace(frame, camera=shift_origin(frame.camera, origin)) for frame in frames]


def _refine_roughly(
    observations: Sequence[Observation], config: MappingConfig, clock: Clock
) -> None:
    """Refine poses and lenses with a coarse map, so that the fine map is seeded sharply."""
    given = observations[0].lenses
    level = 0
    while level + 1 < LEVELS and given.color.width >> (level + 1) >= ROUGH_WIDTH_PX:
        level += 1
    origin = _origin(observations)
    frames = _frames(observations, origin)
    seeds = seed_from_depth(frames, 2 * config.voxel_m, config.seed_contrast)
    seeds = replace(seeds, origin=origin)
    iterations = config.rough_epochs * len(observations)
    times_s = clock.times_s("rough poses", ROUGH_BUDGET_SHARE)
    schedule = Schedule(iterations, ((float("inf"), level),), times_s)
    rough = config.model_copy(update={"growth": 0.0})
    optimizer = Optimizer(seeds, observations, given, rough, schedule)
    while optimizer.share < 1:
        optimizer.run_epoch(lambda _: None)


def _pose_stds(observations: Sequence[Observation], config: MappingConfig) -> tuple[float, float]:
    """Estimate the standard deviations of the given poses, m and rad, from the rough corrections.

    Independent errors of many frames average out in the map, so that given poses together weigh
    more than alone; errors that neighbours share, such as drift, do not. Without any
    corrections, the configured ones are returned.
    """
    twists = np.array([twist_of(frame.correction) for frame in observations])
    if np.abs(twists).max() < ROUNDING:
        return config.pose_std_m, config.pose_std_rad
    stds = []
    for part in np.split(twists, 2, axis=1):
        squares = (part**2).sum(axis=1)
        shared = (part[1:] * part[:-1]).sum() / max(float(squares.sum()), 1e-12)
        own = 1 - float(np.clip(shared, 0, 1))
        stds.append(float(np.sqrt(squares.mean() / 3 / (1 + AVERAGED_FRAMES * own))))
    return (
        min(max(stds[0], MIN_POSE_STD_M), config.pose_std_m),
        min(max(stds[1], MIN_POSE_STD_RAD), config.pose_std_rad),
    )
