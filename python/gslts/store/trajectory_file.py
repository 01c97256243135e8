"""Poses of recordings in the frame of a map: estimated in `trajectory.json`, or of extensions."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from gslts.datasets import Dataset, open_dataset
from gslts.datasets.posed import with_poses
from gslts.io.atomic_files import write_atomic
from gslts.store.camera_files import read_cameras
from gslts.store.causes import ExtensionCause
from gslts.store.fingerprints import is_recording_of
from gslts.store.manifest import split_version
from gslts.store.map_folder import camera_to_json, open_map
from gslts.types import Floats

TRAJECTORY = "trajectory.json"
"""Name of the file; it has the format of `cameras.json`."""


def write_trajectory(path: Path, dataset: Dataset) -> None:
    """Write the poses of a recording atomically.

    Args:
        path: File to write.
        dataset: Frames at the poses.

    Raises:
        OSError: The file cannot be written.
    """
    cameras = {frame.name: camera_to_json(frame.camera) for frame in dataset.frames}
    write_atomic(path, json.dumps(cameras).encode())


def read_trajectory(path: Path) -> dict[str, Floats]:
    """Read the poses of a recording.

    Args:
        path: File that `write_trajectory` wrote.

    Returns:
        World_from_camera [4,4], m, by name of the frame.

    Raises:
        OSError: The file cannot be read.
        ValueError: The file is damaged.
    """
    return {name: camera.world_from_camera for name, camera in read_cameras(path).items()}


def open_recording(map_path: Path, dataset: Path) -> Dataset:
    """Open a recording of the scene of a map, at its poses in the map if these are known.

    Args:
        map_path: Folder of the map, `FOLDER@NUMBER`, or a PLY file.
        dataset: Recording that the map was made of or extended by, or another one with poses in its
            frame. Of an extension, only the training and test frames are there.

    Raises:
        OSError: A file cannot be read.
        ValueError: A file is damaged, or frames have no pose.
    """
    unposed = open_dataset(dataset, posed=False)
    poses: dict[str, Floats] | None = None
    if is_recording_of(map_path, unposed):
        saved = split_version(map_path)[0] / TRAJECTORY
        poses = read_trajectory(saved) if saved.exists() else None
    elif extension := extension_by(map_path, unposed.name):
        frames = dict(zip(extension.names, extension.frames, strict=True))
        cameras = {**frames, **extension.test_frames}
        poses = {name: np.array(camera.world_from_camera) for name, camera in cameras.items()}
    return open_dataset(dataset) if poses is None else with_poses(unposed, poses)


def extension_by(map_path: Path, recording: str) -> ExtensionCause | None:
    """Return the last extension of a map by a recording.

    Args:
        map_path: Folder of the map, `FOLDER@NUMBER`, or a PLY file.
        recording: Name of the data set, if it is not that of the map; see `is_recording_of`.

    Returns:
        The cause of the version; None if no recording of that name extended the map.

    Raises:
        OSError: A file cannot be read.
        ValueError: A file is damaged.
    """
    folder, number = split_version(map_path)
    if not folder.is_dir():
        return None
    with open_map(folder) as store:
        for version in reversed(store.lineage(number)):
            if isinstance(version.cause, ExtensionCause) and version.cause.dataset == recording:
                return version.cause
    return None
