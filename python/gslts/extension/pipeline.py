"""Extension of a map on disk: place a recording, fit what is new, publish a version."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from gslts.change.visibility import Visibility
from gslts.core.camera import Camera, new_viewpoints
from gslts.core.gaussian_map import GaussianMap
from gslts.datasets import Dataset
from gslts.extension.constants import MIN_CHANGED_SHARE, MIN_NEW_SHARE, MIN_SEEN
from gslts.extension.exposure import recording_exposure
from gslts.extension.fit import Patch, make_patch, merge_patch, replay_frames, without_changes
from gslts.extension.new_space import FrameSpace, KnownSpace
from gslts.extension.placement import Placement, place_frames
from gslts.localization.landmark_extraction import extract_landmarks
from gslts.localization.landmark_files import has_landmarks, read_landmarks, write_landmarks
from gslts.localization.relocalizer import Relocalizer
from gslts.mapping.clock import Clock
from gslts.mapping.config import MappingConfig
from gslts.mapping.density.control import max_weights
from gslts.mapping.engine import MIN_WEIGHT, ShowProgress, optimize
from gslts.mapping.evaluation.evaluate import evaluate, refine_pose
from gslts.mapping.evaluation.held_out import TrainingRecord
from gslts.mapping.frames import (
    FrameSplit,
    ShowFrames,
    read_usable,
    require_memory,
    split_held_out,
)
from gslts.mapping.observation import Observation
from gslts.mapping.optimize import Optimizer, Schedule
from gslts.mapping.seeding.depth_seeds import NoSurfaceError
from gslts.rendering.losses import Exposure
from gslts.semantics.map_semantics import MapSemantics
from gslts.store.camera_files import cameras_of_map
from gslts.store.causes import ExtensionCause, ExtensionRecord, UpdateFrame
from gslts.store.map_folder import camera_to_json, open_map
from gslts.store.map_store import MapStore
from gslts.store.records import Version


@dataclass(frozen=True, eq=False)
class MapExtension:
    """Outcome of `extend_map`.

    Attributes:
        version: Newest version of the map after the call.
        record: Counts, times and quality; None if nothing new was seen and the map stays as it is.
        placement: Poses of the frames in the map.
        skipped: Frames that could not be used, and why.
        changed: Names of frames that show changes of what the map knows.
    """

    version: Version
    record: ExtensionRecord | None
    placement: Placement
    skipped: tuple[str, ...]
    changed: tuple[str, ...]


def extend_map(
    path: Path,
    dataset: Dataset,
    config: MappingConfig | None = None,
    *,
    show_frames: ShowFrames = iter,
    on_placed: Callable[[], None] = lambda: None,
    report: ShowProgress = lambda _: None,
) -> MapExtension:
    """Add the space that a recording shows and the map does not know, as a new version.

    What the map knows stays as it is, bit by bit, but for the seam. What changed there since is
    left out: `gslts.update_map` shows it.

    Args:
        path: Folder of the map.
        dataset: The recording, in any world frame; some of its frames must show a part of the map.
        config: Settings of the mapping; None means the defaults.
        show_frames: Shows the progress of reading.
        on_placed: Called after each frame that was compared with the map.
        report: Called after each step of the optimization.

    Raises:
        OSError: A file cannot be read or written, or another process writes the map.
        ValueError: The path is no folder of a map, or too few frames show what it knows.
    """
    config = MappingConfig() if config is None else config
    clock = Clock(None, {})
    with open_map(path, writable=True) as store:
        newest, gaussian_map = store.version(), store.read()
        cameras = list(cameras_of_map(path).values())
        require_memory(dataset.name, dataset.frames)
        record = TrainingRecord(lenses=TrainingRecord.read(path).lenses)
        frames, skipped = read_usable(dataset, record.observe, show_frames)
        clock.note("reading")
        relocalizer = Relocalizer(gaussian_map, read_landmarks(path, gaussian_map))
        placement = place_frames(frames, relocalizer, on_placed)
        clock.note("placing")
        visibility = Visibility(gaussian_map, cameras, config.threads)
        known = KnownSpace(gaussian_map, visibility, config.threads)
        spaces = {name: known.compare(frame.rgbd()) for name, frame in placement.frames.items()}
        clock.note("comparing")
        changed = tuple(
            name for name, space in spaces.items() if space.changed.mean() > MIN_CHANGED_SHARE
        )
        if all(space.new.mean() < MIN_NEW_SHARE for space in spaces.values()):
            return MapExtension(newest, None, placement, skipped, changed)
        split = _split(placement, spaces)
        first_id = newest.next_id
        training = list(split.training.values())
        shown = [spaces[name] for name in split.training]
        try:
            patch = make_patch(gaussian_map, training, shown, config, first_id)
        except NoSurfaceError:
            return MapExtension(newest, None, placement, skipped, changed)
        replays = replay_frames(gaussian_map, cameras, patch, config.threads)
        config = _settings(config, len(training) + len(replays), len(cameras))
        clock.note("seeding")
        exposure = recording_exposure(
            gaussian_map, list(placement.frames.values()), list(spaces.values()), config.threads
        )
        optimizer = _fit(patch, replays, split, exposure, config, clock, report)
        fitted = _without_errors(optimizer, training, visibility, first_id)
        extended = merge_patch(gaussian_map, patch, fitted, first_id)
        clock.note("optimization")
        extended = _add_semantics(path, extended, split, spaces, first_id, config.threads)
        test_psnr_db = _test_psnr_db(extended, split, config.threads)
        clock.note("evaluation")
        result = ExtensionRecord(
            frames=len(frames),
            placed=len(placement.frames),
            new=len(split.names),
            added=int((extended.ids >= first_id).sum()),
            refined=int((~patch.fixed & (patch.gaussian_map.ids < first_id)).sum()),
            iterations=optimizer.iteration,
            test_psnr_db=test_psnr_db,
            seconds=clock.stages,
        )
        cause = ExtensionCause(
            dataset=dataset.name,
            record=result,
            frames=_camera_records(cameras, training),
            test_frames=tuple(split.test.observations),
            landmarks=_write_landmarks(store, extended, split, spaces, config.threads),
        )
        version = store.commit(extended, cause)
    return MapExtension(version, result, placement, skipped, changed)


def _split(placement: Placement, spaces: Mapping[str, FrameSpace]) -> FrameSplit:
    """Split the frames that tell the map something; what changed since is masked out."""
    frames = {
        name: without_changes(frame, spaces[name])
        for name, frame in placement.frames.items()
        if spaces[name].better.mean() >= MIN_NEW_SHARE
    }
    return FrameSplit.of(frames, split_held_out)


def _fit(
    patch: Patch,
    replays: Sequence[Observation],
    split: FrameSplit,
    exposure: Exposure,
    config: MappingConfig,
    clock: Clock,
    report: ShowProgress,
) -> Optimizer:
    """Fit the free Gaussians of a patch to the training frames and the replays."""
    training = [*split.training.values(), *replays]
    optimizer = Optimizer(
        patch.gaussian_map,
        training,
        training[0].lenses,
        config,
        Schedule(config.iterations, ((config.coarse_share, 1), (float("inf"), 0))),
        patch.fixed,
        exposure,
    )
    optimize(optimizer, split, [], clock, report)
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
        centres = [frame.world_from_camera[:3, 3] for frame in frames]
        near_m = np.min([np.linalg.norm(points - centre, axis=1) for centre in centres], axis=0)
        counts = visibility.counts(points, near_m)
        good[new] = counts.through < np.maximum(MIN_SEEN, counts.on)
    return gaussians.select(good)


def _test_psnr_db(gaussian_map: GaussianMap, split: FrameSplit, threads: int) -> float | None:
    starts = split.test.by_neighbours()
    if not starts:
        return None
    refined = [refine_pose(gaussian_map, frame, threads) for frame in starts]
    return evaluate(gaussian_map, refined, threads).psnr_db


def _add_semantics(
    path: Path,
    gaussian_map: GaussianMap,
    split: FrameSplit,
    spaces: Mapping[str, FrameSpace],
    first_id: int,
    threads: int,
) -> GaussianMap:
    """Return the map with semantic features of the new Gaussians, if the map has semantics."""
    semantics = MapSemantics.of_map(path, threads)
    if semantics is None:
        return gaussian_map
    views = [(frame.rgbd(), spaces[name].new) for name, frame in split.training.items()]
    new = gaussian_map.ids >= first_id
    return semantics.update_features(gaussian_map, new, views, threads)


def _write_landmarks(
    store: MapStore,
    gaussian_map: GaussianMap,
    split: FrameSplit,
    spaces: Mapping[str, FrameSpace],
    threads: int,
) -> str | None:
    """Write the landmarks of new space, and return the SHA-256 of the file; None if none."""
    if not has_landmarks(store.folder):
        return None
    landmarks = extract_landmarks(
        gaussian_map,
        (frame.rgbd() for frame in split.training.values()),
        (spaces[name].new for name in split.training),
        threads=threads,
    )
    return write_landmarks(landmarks, store.folder) if landmarks.size else None


def _camera_records(
    known: Iterable[Camera], frames: Iterable[Observation]
) -> tuple[UpdateFrame, ...]:
    cameras = [frame.camera() for frame in frames]
    return tuple(
        UpdateFrame(**camera_to_json(camera), new_viewpoint=new)
        for camera, new in zip(cameras, new_viewpoints(known, cameras), strict=True)
    )
