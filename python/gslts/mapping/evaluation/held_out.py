"""Test frames of a finished map: frames of a data set that neither trained nor validated it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path
from typing import Any

from gslts.core.camera import Camera
from gslts.datasets import Dataset, Frame
from gslts.mapping.frames import (
    HELD_OUT_EVERY,
    HeldOutFrames,
    ShowFrames,
    neighbours_of,
    observe,
    read_usable,
    require_memory,
)
from gslts.mapping.lenses import Lenses
from gslts.mapping.observation import Observation
from gslts.store.camera_files import cameras_of_map
from gslts.store.fingerprints import is_recording_of
from gslts.store.manifest import read_manifest, split_version
from gslts.store.map_folder import camera_from_json
from gslts.store.trajectory_file import extension_by


@dataclass(frozen=True, eq=False)
class TrainingRecord:
    """Frames and lenses that a map was made with, as far as they are those of a recording.

    It has no frames of another recording, though its frames may have the same names, and is empty
    for a plain PLY file.

    Attributes:
        cameras: Refined cameras of the training frames, by name.
        validation: Names of the validation frames.
        lenses: Given and refined lenses, if they are known.
    """

    cameras: Mapping[str, Camera] = field(default_factory=dict)
    validation: frozenset[str] = frozenset()
    lenses: tuple[Lenses, Lenses] | None = None

    @classmethod
    def read(cls, path: Path, recording: Dataset | None = None) -> TrainingRecord:
        """Read the record of a map.

        Args:
            path: Folder of the map, or a PLY file.
            recording: If the map was extended by it, the frames are those of the extension. None
                means the recording of the map.

        Raises:
            OSError: A file cannot be read.
            ValueError: A file is damaged.
        """
        folder, _ = split_version(path)
        if not folder.is_dir():
            return cls()
        manifest, cameras = read_manifest(folder), cameras_of_map(path)
        validation = manifest.get("validation_frames", [])
        if not isinstance(validation, list) or not all(isinstance(n, str) for n in validation):
            raise ValueError(f"{path}: validation_frames of the manifest: expected a list of names")
        if recording is not None and not is_recording_of(path, recording):
            cameras, validation = _cameras_of_extension(path, recording.name), []
        if "lenses" not in manifest:
            return cls(cameras, frozenset(validation))
        try:
            given, found = (_lenses(manifest["lenses"][kind]) for kind in ("given", "found"))
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError(f"{path}: lenses of the manifest: {error}") from None
        return cls(cameras, frozenset(validation), (given, found))

    def observe(self, frame: Frame) -> Observation:
        """Read a frame with the refined lenses (if its sensor is the same) and refined pose.

        Args:
            frame: Of the data set of the map, or of another one of the same scene.

        Raises:
            OSError: A file cannot be read.
            ValueError: A file is damaged, or the mask of the frame leaves nothing.
        """
        observation = observe(frame)
        if self.lenses is not None and observation.lenses.is_close(self.lenses[0]):
            observation.set_lenses(self.lenses[1])
        if frame.name in self.cameras:
            return observation.at_pose(self.cameras[frame.name].world_from_camera)
        return observation.at_pose(observation.given_pose)

    def split(self, names: Sequence[str]) -> tuple[list[int], list[int]]:
        """Return the validation and the test frames, as indices of names.

        Args:
            names: Usable frames in the order of the data set.
        """
        validation = [k for k, name in enumerate(names) if name in self.validation]
        return validation, self.choose_test(names)

    def choose_test(self, names: Sequence[str], every: int | None = None) -> list[int]:
        """Return the test frames, as indices of names.

        Args:
            names: Usable frames in the order of the data set.
            every: Take every n-th frame; None means the frames that neither trained nor validated
                the map, or every 8th if the map knows none of the frames.
        """
        used = self.cameras.keys() | self.validation
        chosen = [k for k, name in enumerate(names) if name not in used]
        if every is not None or len(chosen) == len(names):
            chosen = list(range(0, len(names), every or HELD_OUT_EVERY))
        return chosen


def read_test_frames(
    dataset: Dataset,
    record: TrainingRecord,
    every: int | None = None,
    show_frames: ShowFrames = iter,
) -> tuple[HeldOutFrames, tuple[str, ...]]:
    """Read the test frames of a map and their neighbours among the training frames.

    Frames that cannot be used are left out, as in mapping; see `read_usable`.

    Args:
        dataset: Data set of the map, or another one of the same scene.
        record: Record of the map.
        every: See `TrainingRecord.choose_test`.
        show_frames: Shows the progress of reading, if all frames must be read.

    Returns:
        The test frames, and for each frame that cannot be used the reason.

    Raises:
        ValueError: There is no test frame, or too many frames cannot be used.
    """
    frames = {frame.name: frame for frame in dataset.frames[::-1]}  # Of equal names, the first.
    skipped = dataset.left_out
    wanted = _choose_names([frame.name for frame in dataset.frames], record, every)
    require_memory(dataset.name, [frames[name] for name in _all(wanted)])
    read = None if len(frames) < len(dataset.frames) else _read(wanted, frames, record)
    if read is None:
        # Only all frames tell whether too many are bad, and which good ones are neighbours.
        usable, skipped = read_usable(
            dataset, lambda frame: _without_images(record.observe(frame)), show_frames
        )
        wanted = _choose_names(list(usable), record, every)
        read = {name: record.observe(frames[name]) for name in _all(wanted)}
    if not wanted:
        why = f" that can be used; {skipped[-1]}" if skipped else ""
        raise ValueError(
            f"{dataset.name}: there is no test frame: the map was made from all of its frames{why}"
        )
    neighbours = [[read[name] for name in near] for near in wanted.values()]
    return HeldOutFrames({name: read[name] for name in wanted}, neighbours), skipped


def _cameras_of_extension(path: Path, recording: str) -> dict[str, Camera]:
    """Return the training cameras of an extension by name; none if there is no such extension."""
    extension = extension_by(path, recording)
    if extension is None:
        return {}
    records = (frame.model_dump(exclude={"new_viewpoint"}) for frame in extension.frames)
    return dict(zip(extension.names, map(camera_from_json, records), strict=True))


def _choose_names(
    names: Sequence[str], record: TrainingRecord, every: int | None
) -> dict[str, list[str]]:
    """Return the test frames, and for each its neighbours among the training frames."""
    beside = neighbours_of(names)
    return {
        names[k]: [name for name in beside[names[k]] if name in record.cameras]
        for k in record.choose_test(names, every)
    }


def _all(wanted: Mapping[str, Sequence[str]]) -> set[str]:
    return {*wanted, *chain.from_iterable(wanted.values())}


def _read(
    wanted: Mapping[str, Sequence[str]], frames: Mapping[str, Frame], record: TrainingRecord
) -> dict[str, Observation] | None:
    """Read frames by name; None if one cannot be read, or only some have depth."""
    try:
        read = {name: record.observe(frames[name]) for name in _all(wanted)}
    except (OSError, ValueError):
        return None
    return None if len({frame.has_depth for frame in read.values()}) > 1 else read


def _without_images(observation: Observation) -> Observation:
    """Drop the images, but not whether there is depth: memory may not hold those of all frames."""
    depth = observation.raw_depth[0].max(keepdims=True)
    return replace(observation, rgb=(), raw_depth=(depth,), masks=None)


def _lenses(plain: Mapping[str, Any]) -> Lenses:
    return Lenses(camera_from_json(plain["color"]), camera_from_json(plain["depth"]))
