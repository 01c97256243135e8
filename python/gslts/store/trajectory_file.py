"""Estimated poses of the recording of a map: `trajectory.json` in the folder of the map."""

from __future__ import annotations

import json
from pathlib import Path

from gslts.datasets import Dataset, open_dataset
from gslts.datasets.posed import with_poses
from gslts.io.atomic_files import write_atomic
from gslts.store.camera_files import read_cameras
from gslts.store.manifest import split_version
from gslts.store.map_folder import camera_to_json
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
    """Open a recording of the scene of a map, at the poses that were estimated for it.

    Args:
        map_path: Folder of the map, `FOLDER@NUMBER`, or a PLY file.
        dataset: Recording that the map was made of, or another one with poses in its frame.

    Raises:
        OSError: A file cannot be read.
        ValueError: A file is damaged, or frames have no pose.
    """
    saved = split_version(map_path)[0] / TRAJECTORY
    if saved.exists():
        opened = with_poses(open_dataset(dataset, posed=False), read_trajectory(saved))
        if opened.frames:
            return opened
    return open_dataset(dataset)
