"""Which formats of data sets there are, and how to tell them apart."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from gslts.datasets.colmap import is_colmap, open_colmap
from gslts.datasets.dataset import Dataset
from gslts.datasets.nerfstudio import is_nerfstudio, open_nerfstudio
from gslts.datasets.ros.dataset import is_rosbag, open_rosbag
from gslts.datasets.seven_scenes import is_seven_scenes, open_seven_scenes
from gslts.datasets.tum import is_tum, open_tum

FORMATS: dict[str, tuple[Callable[[Path], bool], Callable[[Path], Dataset]]] = {
    "nerfstudio": (is_nerfstudio, open_nerfstudio),
    "7scenes": (is_seven_scenes, open_seven_scenes),
    "tum": (is_tum, open_tum),
    "colmap": (is_colmap, open_colmap),
    "rosbag": (is_rosbag, open_rosbag),
}
"""For each format, whether a path looks like it, and what opens it."""

LEAST_FRAMES = 2


def open_dataset(path: str | os.PathLike[str], *, posed: bool = True) -> Dataset:
    """Opens a data set of any known format.

    Args:
        path: A folder or a file.
        posed: Whether a frame needs a pose; if not, `frames` has those of `unposed`, too, for those
            who find poses by themselves.

    Raises:
        OSError: There is no such path.
        ValueError: It is of no known format, or fewer than two of its frames can be used.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"{path}: there is no such file or folder")
    for looks_like, open_it in FORMATS.values():
        if looks_like(path):
            dataset = _usable(open_it(path), posed)
            if len(dataset.frames) < LEAST_FRAMES:
                why = f"; {dataset.skipped[0]}" if dataset.skipped else ""
                raise ValueError(
                    f"{path}: {len(dataset.frames)} usable frames, at least {LEAST_FRAMES} are "
                    f"needed{why}"
                )
            return dataset
    raise ValueError(f"{path}: no data set of a known format ({', '.join(FORMATS)})")


def _usable(dataset: Dataset, posed: bool) -> Dataset:
    if not posed:
        return replace(dataset, frames=(*dataset.frames, *dataset.unposed))
    left_out = tuple(f"{one.name}: it has no pose" for one in dataset.unposed)
    return replace(dataset, skipped=(*dataset.skipped, *left_out))
