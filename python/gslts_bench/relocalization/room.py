"""Recorded rooms, mapped from some of their frames, and corrected poses of all frames."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from gslts.core.se3 import fit_rigid_motion
from gslts.datasets import Dataset, Frame, open_dataset
from gslts.io.atomic_files import write_atomic
from gslts.mapping.config import MappingConfig
from gslts.mapping.engine import make_map
from gslts.mapping.report.summary import write_result
from gslts.types import Floats
from gslts_bench.cache import cached_folder, code_digest, native_digest

FOLDS = 8
"""Number of maps of a room: each frame is held out of one and in all others."""
ARM_M = 2.0
"""Distance of the surfaces in a room, which weighs rotations against translations."""
POSES = "poses.json"
"""File of corrected poses."""


@dataclass(frozen=True)
class RecordedRoom:
    """A data set of one room.

    Attributes:
        path: File or folder of the data set.
        content: SHA-256 of its files.
        mapping: Settings of the mapping.
        work: Folder where everything made is kept.
        code: Digests of the code that makes maps; see `HomeSetup`.
    """

    path: Path
    content: str
    mapping: MappingConfig
    work: Path
    code: dict[str, Any] = field(
        default_factory=lambda: {"python": code_digest(__name__), "native": native_digest()}
    )

    @classmethod
    def of(cls, path: Path, mapping: MappingConfig, work: Path) -> RecordedRoom:
        """Open a data set.

        Args:
            path: Anything that `open_dataset` opens.
            mapping: Settings of the mapping.
            work: Folder where everything made is kept.

        Raises:
            OSError: A file cannot be read.
            ValueError: It is no data set, or too small.
        """
        dataset = open_dataset(path)
        if len(dataset.frames) < 2 * FOLDS:
            raise ValueError(
                f"{path}: {len(dataset.frames)} frames are too few to hold out an eighth"
            )
        return cls(path, content_digest(path), mapping, work)

    @property
    def name(self) -> str:
        """Name of the file or folder."""
        return self.path.resolve().name

    @property
    def dataset(self) -> Dataset:
        """The data set with all frames."""
        return open_dataset(self.path)

    @property
    def corrected_of(self) -> dict[str, Any]:
        """JSON values that decide the corrected poses; the number of threads is not among them."""
        return {
            "dataset": self.content,
            "mapping": self.mapping.model_dump(exclude={"threads"}),
            "code": self.code,
        }

    def corrected_poses(self) -> dict[str, Floats]:
        """Return world_from_camera [4,4] by frame as corrected by a map of all frames.

        The held-out frames of that map are refined in it afterwards.
        """

        def make(folder: Path) -> None:
            result = make_map(self.dataset, self.mapping_config)
            every = {**result.training, **result.held_out}
            folder.mkdir()
            poses = {name: found.world_from_camera.tolist() for name, found in every.items()}
            write_atomic(folder / POSES, (json.dumps(poses) + "\n").encode())

        folder = cached_folder(self.work / "poses" / self.name, self.corrected_of, make)
        poses = json.loads((folder / POSES).read_bytes())
        return {name: np.array(pose) for name, pose in poses.items()}

    @property
    def mapping_config(self) -> MappingConfig:
        """Settings of the mapping on one thread."""
        return self.mapping.model_copy(update={"threads": 1})


@dataclass(frozen=True)
class RoomFold:
    """A recorded room without every n-th frame.

    Attributes:
        room: The room.
        fold: Number of the first held-out frame, from 0.
        every: n; there are so many folds.
    """

    room: RecordedRoom
    fold: int
    every: int = FOLDS

    @property
    def name(self) -> str:
        """Name of room and fold, such as `7scenes_without_3`."""
        suffix = "" if self.every == FOLDS else f"_of_{self.every}"
        return f"{self.room.name}_without_{self.fold}{suffix}"

    @property
    def work(self) -> Path:
        """Folder where everything made is kept."""
        return self.room.work

    @property
    def frames(self) -> tuple[Frame, ...]:
        """Held-out frames."""
        return self.room.dataset.frames[self.fold :: self.every]

    @property
    def mapped_of(self) -> dict[str, Any]:
        """JSON values that decide its map."""
        return {**self.room.corrected_of, "without": [self.fold, self.every]}

    def map(self) -> Path:
        """Return the folder of the map without the held-out frames; make it once."""

        def make(folder: Path) -> None:
            dataset = self.room.dataset
            frames = [
                frame for k, frame in enumerate(dataset.frames) if k % self.every != self.fold
            ]
            result = make_map(replace(dataset, frames=tuple(frames)), self.room.mapping_config)
            write_result(folder, result, dataset.name)

        return cached_folder(self.work / "maps" / self.name, self.mapped_of, make)


def transfer(poses: Mapping[str, Floats], known: Mapping[str, Floats]) -> dict[str, Floats]:
    """Transfer poses of one map into the world of another one.

    Args:
        poses: world_from_camera [4,4] in the first map by frame.
        known: The same in the second; frames in both give the motion between the worlds.

    Returns:
        All of `poses` in the world of the second map.

    Raises:
        ValueError: The maps have no frame in common.
    """
    both = [name for name in poses if name in known]
    if not both:
        raise ValueError("transfer: the maps have no frame in common")
    start, end = (np.array([some[name] for name in both]) for some in (poses, known))
    motion = fit_rigid_motion(start, end, ARM_M)
    return {name: motion @ pose for name, pose in poses.items()}


def content_digest(path: Path) -> str:
    """Compute the SHA-256 of a file, or of all files of a folder with their paths in it.

    Args:
        path: File or folder.

    Raises:
        OSError: A file cannot be read.
    """
    files = (
        sorted(child for child in path.rglob("*") if child.is_file()) if path.is_dir() else [path]
    )
    result = hashlib.sha256()
    for source in files:
        with source.open("rb") as file:
            of_file = hashlib.file_digest(file, "sha256").hexdigest()
        result.update(f"{source.relative_to(path).as_posix()} {of_file}\n".encode())
    return result.hexdigest()
