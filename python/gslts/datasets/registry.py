"""Registry of the data set formats. A new format is one module with `is_...` and `open_...`."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from gslts.datasets.colmap import is_colmap, open_colmap
from gslts.datasets.dataset import Dataset, Frame, join_reasons
from gslts.datasets.nerfstudio import is_nerfstudio, open_nerfstudio
from gslts.datasets.polycam import is_polycam, open_polycam
from gslts.datasets.record3d import is_record3d, open_record3d
from gslts.datasets.replica import is_replica, open_replica
from gslts.datasets.ros.dataset import is_rosbag, open_rosbag
from gslts.datasets.rtabmap import is_rtabmap, open_rtabmap
from gslts.datasets.scannet import is_scannet, open_scannet
from gslts.datasets.sens import is_sens, open_sens
from gslts.datasets.seven_scenes import is_seven_scenes, open_seven_scenes
from gslts.datasets.tum import is_tum, open_tum

FORMATS: dict[str, tuple[Callable[[Path], bool], Callable[[Path], Dataset]]] = {
    "nerfstudio": (is_nerfstudio, open_nerfstudio),
    "7scenes": (is_seven_scenes, open_seven_scenes),
    "tum": (is_tum, open_tum),
    "colmap": (is_colmap, open_colmap),
    "rosbag": (is_rosbag, open_rosbag),
    "record3d": (is_record3d, open_record3d),
    "polycam": (is_polycam, open_polycam),
    "rtabmap": (is_rtabmap, open_rtabmap),
    "scannet": (is_scannet, open_scannet),
    "sens": (is_sens, open_sens),
    "replica": (is_replica, open_replica),
}
"""Name of each format, its test of a path, and its reader; the first that matches is used."""

MIN_FRAMES = 2
"""Minimum number of usable frames of a data set: one to map, one to judge the map."""


def open_dataset(path: str | os.PathLike[str], *, posed: bool = True) -> Dataset:
    """Open a data set of any registered format.

    Args:
        path: A folder or a file.
        posed: True if frames need a pose. If False, `frames` also holds those of `unposed`, for
            callers who localize frames themselves, in the order of the recording.

    Raises:
        OSError: The path does not exist or cannot be read.
        ValueError: The format is unknown, or fewer than two frames can be used.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"{path}: there is no such file or folder")
    for matches, open_path in FORMATS.values():
        if matches(path):
            dataset = _select_usable(open_path(path), posed)
            if len(dataset.frames) < MIN_FRAMES:
                why = "".join(f"; {line}" for line in join_reasons(dataset.left_out)[:1])
                if len(dataset.unposed) >= MIN_FRAMES:
                    why += "; gslts map --poses estimate finds poses by the images"
                raise ValueError(
                    f"{path}: {len(dataset.frames)} usable frames, at least {MIN_FRAMES} are "
                    f"needed{why}"
                )
            return dataset
    raise ValueError(f"{path}: no data set of a known format ({', '.join(FORMATS)})")


def _select_usable(dataset: Dataset, posed: bool) -> Dataset:
    if not posed:
        return replace(dataset, frames=_in_order(dataset))
    without_pose = tuple(f"{frame.name}: {dataset.why_unposed}" for frame in dataset.unposed)
    return replace(dataset, skipped=(*dataset.skipped, *without_pose))


def _in_order(dataset: Dataset) -> tuple[Frame, ...]:
    """Return frames with and without poses in the order of the recording: by name if both exist.

    Frame 10 comes after frame 9, whatever the number of digits.
    """
    frames = (*dataset.frames, *dataset.unposed)
    if not (dataset.frames and dataset.unposed):
        return frames
    return tuple(sorted(frames, key=lambda frame: _with_numbers(frame.name)))


def _with_numbers(name: str) -> list[tuple[int, str]]:
    """Return a key that orders names by their numbers: each part is a number or a text."""
    parts = re.findall(r"\d+|\D+", name)
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in parts]
