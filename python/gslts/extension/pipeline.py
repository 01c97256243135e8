"""Extension of a map on disk: place a recording, fit what is new, publish a version."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from gslts.change.visibility import Visibility
from gslts.core.camera import Camera
from gslts.core.gaussian_map import GaussianMap
from gslts.datasets import Dataset
from gslts.extension.constants import MIN_CHANGED_SHARE
from gslts.extension.grow import Growth, compare_frames, grow_map, measure_test_psnr_db
from gslts.extension.new_space import FrameSpace
from gslts.extension.placement import Placement, place_frames
from gslts.localization.config import RelocalizationConfig
from gslts.localization.landmark_extraction import extract_landmarks
from gslts.localization.landmark_files import has_landmarks, read_landmarks, write_landmarks
from gslts.localization.relocalizer import Relocalizer
from gslts.mapping.clock import Clock
from gslts.mapping.config import MappingConfig
from gslts.mapping.engine import ShowProgress
from gslts.mapping.evaluation.held_out import TrainingRecord
from gslts.mapping.frames import FrameSplit, ShowFrames, read_usable, require_memory
from gslts.mapping.measure import measure_recording
from gslts.mapping.observation import Observation
from gslts.semantics.map_semantics import MapSemantics
from gslts.store.camera_files import cameras_of_map, frame_records
from gslts.store.causes import CameraRecord, ExtensionCause, ExtensionRecord
from gslts.store.map_folder import camera_to_json, open_map
from gslts.store.map_store import MapStore
from gslts.store.measurement_files import write_measurements
from gslts.store.measurements import Measurements
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
    path: Path | str,
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
    path = Path(path)
    config = MappingConfig() if config is None else config
    clock = Clock(None, {})
    with open_map(path, writable=True) as store:
        require_memory(dataset.name, dataset.frames)
        mapped = TrainingRecord(lenses=TrainingRecord.read(path).lenses)
        frames, skipped = read_usable(dataset, mapped.observe, show_frames)
        clock.note("reading")
        outcome = extend_store(
            store, frames, dataset.name, config, clock, on_placed=on_placed, report=report
        )
    return replace(outcome, skipped=skipped)


def extend_store(
    store: MapStore,
    frames: Mapping[str, Observation],
    source: str,
    config: MappingConfig,
    clock: Clock,
    *,
    on_placed: Callable[[], None] = lambda: None,
    report: ShowProgress = lambda _: None,
) -> MapExtension:
    """Add the space that frames in memory show and the map does not know; see `extend_map`.

    Args:
        store: Of the map, open for writing.
        frames: By name, in the order in which they were taken.
        source: Name of the recording or the robot.
        config: Settings of the mapping.
        clock: Notes the stages.
        on_placed: Called after each frame that was compared with the map.
        report: Called after each step of the optimization.

    Raises:
        OSError: A file cannot be read or written.
        ValueError: Too few frames show what the map knows.
    """
    path, newest, gaussian_map = store.folder, store.version(), store.read()
    cameras = list(cameras_of_map(path).values())
    relocalizer = Relocalizer(
        gaussian_map,
        read_landmarks(path, gaussian_map),
        RelocalizationConfig(threads=config.threads),
    )
    placement = place_frames(frames, relocalizer, on_placed)
    clock.note("placing")
    visibility = Visibility(gaussian_map, cameras, config.threads)
    spaces = compare_frames(gaussian_map, visibility, placement.frames, config.threads)
    clock.note("comparing")
    changed = tuple(
        name for name, space in spaces.items() if space.changed.mean() > MIN_CHANGED_SHARE
    )
    growth = grow_map(
        gaussian_map,
        cameras,
        visibility,
        placement.frames,
        spaces,
        config,
        newest.next_id,
        clock,
        report,
    )
    if growth is None:
        return MapExtension(newest, None, placement, (), changed)
    extended = _add_semantics(path, growth, spaces, newest.next_id, config.threads)
    test_psnr_db = measure_test_psnr_db(extended, growth.split, config.threads)
    clock.note("evaluation")
    training = list(growth.split.training.values())
    measured = measure_recording(extended, training, config.threads).of_new(newest.next_id)
    clock.note("measuring")
    record = ExtensionRecord(
        frames=len(frames),
        placed=len(placement.frames),
        new=len(growth.split.names),
        added=int((extended.ids >= newest.next_id).sum()),
        refined=growth.refined,
        iterations=growth.iterations,
        test_psnr_db=test_psnr_db,
        seconds=clock.stages,
    )
    version = _publish(store, extended, cameras, growth.split, spaces, measured, source, record)
    return MapExtension(version, record, placement, (), changed)


def _publish(
    store: MapStore,
    extended: GaussianMap,
    cameras: Sequence[Camera],
    split: FrameSplit,
    spaces: Mapping[str, FrameSpace],
    measured: Measurements,
    dataset: str,
    record: ExtensionRecord,
) -> Version:
    """Write landmarks and measurements of new space, and commit the version."""
    cause = ExtensionCause(
        dataset=dataset,
        record=record,
        names=tuple(split.training),
        frames=frame_records(cameras, [frame.camera() for frame in split.training.values()]),
        test_frames={
            name: CameraRecord(**camera_to_json(frame.camera()))
            for name, frame in split.test.observations.items()
        },
        landmarks=_write_landmarks(store, extended, split, spaces),
        measurements=write_measurements(measured, store.folder),
    )
    return store.commit(extended, cause)


def _add_semantics(
    path: Path,
    growth: Growth,
    spaces: Mapping[str, FrameSpace],
    first_id: int,
    threads: int,
) -> GaussianMap:
    """Return the map with semantic features of the new Gaussians, if the map has semantics."""
    semantics = MapSemantics.of_map(path, threads)
    if semantics is None:
        return growth.gaussian_map
    training = growth.split.training
    views = [(frame.rgbd(), spaces[name].new) for name, frame in training.items()]
    new = growth.gaussian_map.ids >= first_id
    return semantics.update_features(growth.gaussian_map, new, views, threads)


def _write_landmarks(
    store: MapStore,
    gaussian_map: GaussianMap,
    split: FrameSplit,
    spaces: Mapping[str, FrameSpace],
) -> str | None:
    """Write the landmarks of new space, and return the SHA-256 of the file; None if none."""
    if not has_landmarks(store.folder):
        return None
    landmarks = extract_landmarks(
        gaussian_map,
        (frame.rgbd() for frame in split.training.values()),
        (spaces[name].new for name in split.training),
    )
    return write_landmarks(landmarks, store.folder) if landmarks.size else None
