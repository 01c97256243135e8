"""Estimation of the poses of a recording: odometry by keyframes, loop closures, a pose graph."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, groupby
from operator import itemgetter

import numpy as np

from gslts.core.in_threads import map_in_threads
from gslts.core.se3 import product, transform
from gslts.datasets import Dataset, Frame
from gslts.datasets.posed import with_poses
from gslts.datasets.poses import inverse
from gslts.trajectory.completion import place_rest
from gslts.trajectory.drift import DriftingPoses
from gslts.trajectory.features import FrameFeatures
from gslts.trajectory.loops import find_loops
from gslts.trajectory.odometry import KeyframeOdometry
from gslts.trajectory.pose_graph import Edge, optimize_poses
from gslts.trajectory.registration import Motion, register_frames
from gslts.trajectory.upright import upright_world
from gslts.types import Floats

ShowFrames = Callable[[Sequence[Frame]], Iterable[Frame]]
ShowLoops = Callable[[Sequence[tuple[int, int]]], Iterable[tuple[int, int]]]


@dataclass(frozen=True, eq=False)
class EstimatedPoses:
    """A recording at estimated poses.

    Attributes:
        dataset: The frames that could be placed. Where given poses were corrected, the world is
            theirs, by the first placed frame; otherwise it has z up, and its origin is the first
            camera, which looks along x.
        unplaced: The other frames, and why.
        keyframes: Number of keyframes.
        loops: Number of registered pairs of keyframes that do not follow each other.
    """

    dataset: Dataset
    unplaced: tuple[str, ...]
    keyframes: int
    loops: int


def estimate_poses(
    dataset: Dataset,
    *,
    correct: bool = False,
    threads: int = 0,
    show_frames: ShowFrames = iter,
    show_loops: ShowLoops = iter,
) -> EstimatedPoses:
    """Estimate the poses of an RGB-D recording of a static scene from its images.

    Each frame is registered with the last keyframe, keyframes that show the same place with each
    other, and a pose graph finds the poses that agree best with all these motions.

    Args:
        dataset: Frames with depth, in the order in which they were taken, as
            `open_dataset(path, posed=False)` gives them.
        correct: True if the given poses are those of an odometry that drifts: they serve where
            images tell nothing. False if they are not used.
        threads: Number of threads; 0 uses all hardware threads. The result is the same for any.
        show_frames: Shows the progress of reading.
        show_loops: Shows the progress of the search for loop closures.

    Raises:
        ImportError: Open3D is missing.
        ValueError: Fewer than two frames show the same place.
    """
    odometry, unplaced = KeyframeOdometry(), list[str]()
    given: dict[str, Floats] = {}
    if correct:
        without = {frame.name for frame in dataset.unposed}
        given = {
            frame.name: frame.camera.world_from_camera
            for frame in dataset.frames
            if frame.name not in without
        }
    features = map_in_threads(_features_of, dataset.frames, threads)
    for frame, found in zip(show_frames(dataset.frames), features, strict=True):
        if isinstance(found, FrameFeatures):
            odometry.add(frame.name, found, given.get(frame.name))
        else:
            unplaced.append(f"{frame.name}: {found}")
    loops = _close_loops(odometry.keyframes, show_loops, threads)
    loops = _allowed_by(given, odometry.names, loops)
    edges = [*odometry.edges, *loops]
    placed = optimize_poses(len(odometry.keyframes), edges)
    placed = place_rest(placed, edges, odometry.keyframes)
    in_keyframes = odometry.anchors.items()
    poses = {name: product(placed[k], motion) for name, (k, motion) in in_keyframes if k in placed}
    if len(poses) < 2:
        raise ValueError(
            f"{dataset.name}: no two frames show the same place, so that no pose can be "
            "estimated: record depth with the images, slowly enough that each frame shows most of "
            "what the one before showed"
        )
    first = next(iter(poses))
    if first in given:
        world = product(given[first], inverse(poses[first]))
    else:
        world = _upright(placed, odometry.keyframes)
    unplaced += [
        f"{name}: no other frame surely shows the same place"
        for name in odometry.anchors
        if name not in poses
    ]
    posed = with_poses(dataset, {name: product(world, pose) for name, pose in poses.items()})
    return EstimatedPoses(posed, tuple(unplaced), len(odometry.keyframes), len(loops))


def _upright(placed: Mapping[int, Floats], keyframes: Sequence[FrameFeatures]) -> Floats:
    """Return the motion [4,4] to a world with z up."""
    points = [transform(pose, keyframes[k].cloud.astype(np.float64)) for k, pose in placed.items()]
    return upright_world(np.array(list(placed.values())), np.concatenate(points))


def _features_of(frame: Frame) -> FrameFeatures | Exception:
    """Return the features of a frame, or why it cannot be read."""
    try:
        return FrameFeatures.of(frame.read())
    except (OSError, ValueError) as error:
        return error


def _close_loops(
    keyframes: Sequence[FrameFeatures], show_loops: ShowLoops, threads: int
) -> list[Edge]:
    """Register keyframes that do not follow each other; the index of one at a time is kept."""

    def register(group: Sequence[tuple[int, int]]) -> list[Motion | None]:
        earlier = keyframes[group[0][1]]
        motions = [register_frames(keyframes[later], earlier) for later, _ in group]
        earlier.drop_index()
        return motions

    pairs = sorted(find_loops(keyframes, threads), key=itemgetter(1))
    groups = [list(group) for _, group in groupby(pairs, itemgetter(1))]
    motions = chain.from_iterable(map_in_threads(register, groups, threads))
    found = zip(show_loops(pairs), motions, strict=True)
    edges = (Edge(*pair, motion) for pair, motion in found if motion is not None)
    return sorted(edges, key=lambda edge: (edge.source, edge.target))


def _allowed_by(
    given: Mapping[str, Floats], names: Sequence[str], loops: Sequence[Edge]
) -> list[Edge]:
    """Return the loop closures that an odometry allows for, up to drift."""
    rows = {name: row for row, name in enumerate(given)}
    drifting = DriftingPoses(list(given.values()))

    def is_allowed(loop: Edge) -> bool:
        target, source = (rows.get(names[node]) for node in (loop.target, loop.source))
        if target is None or source is None:
            return True
        return drifting.allows(target, source, loop.motion.target_from_source)

    return [loop for loop in loops if is_allowed(loop)]
