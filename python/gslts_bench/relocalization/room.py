"""A recorded room, mapped from some of its frames, and where mapping puts all of them."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from gslts.core.se3 import fit_rigid_motion
from gslts.datasets import Dataset, open_dataset
from gslts.io.atomic_files import write_whole
from gslts.mapping.config import MappingConfig
from gslts.mapping.engine import make_map
from gslts.mapping.optimize import Progress
from gslts.mapping.report.summary import write_result
from gslts.types import Floats
from gslts_bench.cache import cached_folder, code_digest, native_digest
from gslts_bench.homes import Tell

FOLDS = 8
"""Each frame is left out of one map, and is in all others."""
ARM_M = 2.0
"""About how far away what a camera in a room sees is."""
ROOM_S = 300.0
"""About how long a map of a hundred frames takes, for the progress."""
POSES = "poses.json"


@dataclass(frozen=True)
class RecordedRoom:
    """A data set of one room.

    Attributes:
        path: Of the data set.
        content: SHA-256 of its files.
        mapping: How maps are made.
        work: Folder where what was made is kept.
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
        """Of any data set that `open_dataset` opens.

        Raises:
            OSError: A file cannot be read.
            ValueError: It is no data set, or too small.
        """
        dataset = open_dataset(path)
        if len(dataset.frames) < 2 * FOLDS:
            raise ValueError(
                f"{path}: {len(dataset.frames)} frames are too few to leave out an eighth"
            )
        return cls(path, content_of(path), mapping, work)

    @property
    def name(self) -> str:
        """That of the file or folder."""
        return self.path.resolve().name

    @property
    def dataset(self) -> Dataset:
        """All of its frames."""
        return open_dataset(self.path)

    @property
    def corrected_of(self) -> dict[str, Any]:
        """All that decides where mapping puts its frames; the number of threads does not."""
        return {
            "dataset": self.content,
            "mapping": self.mapping.model_dump(exclude={"threads"}),
            "code": self.code,
        }

    def mapped_of(self, fold: int) -> dict[str, Any]:
        """All that decides what the map without a fold is."""
        return {**self.corrected_of, "without": [fold, FOLDS]}

    def map(self, fold: int, tell: Tell = lambda _: None) -> Path:
        """The folder of the map without every eighth frame from `fold` on, made unless there."""

        def make(folder: Path) -> None:
            dataset = self.dataset
            frames = [one for k, one in enumerate(dataset.frames) if k % FOLDS != fold]
            dataset = replace(dataset, frames=tuple(frames))
            result = make_map(dataset, self._config, report=_reporting(tell))
            write_result(folder, result, dataset.name)

        folder = self.work / "maps" / f"{self.name}_without_{fold}"
        return cached_folder(folder, self.mapped_of(fold), make)

    def corrected(self, tell: Tell = lambda _: None) -> dict[str, Floats]:
        """[4,4] world_from_camera of each frame as corrected by a map of all of them, by name.

        Those that judged that map were refined in it afterwards.
        """

        def make(folder: Path) -> None:
            result = make_map(self.dataset, self._config, report=_reporting(tell))
            every = {**result.training, **result.held_out}
            folder.mkdir()
            poses = {name: frame.world_from_camera.tolist() for name, frame in every.items()}
            write_whole(folder / POSES, (json.dumps(poses) + "\n").encode())

        folder = cached_folder(self.work / "poses" / self.name, self.corrected_of, make)
        poses = json.loads((folder / POSES).read_bytes())
        return {name: np.array(pose) for name, pose in poses.items()}

    @property
    def _config(self) -> MappingConfig:
        return self.mapping.model_copy(update={"threads": 1})


def brought_to(poses: Mapping[str, Floats], known: Mapping[str, Floats]) -> dict[str, Floats]:
    """Poses of one map [4,4], by name, in the world of another one.

    Args:
        poses: Of the one.
        known: Of the other; those of the same frames tell the motion between the worlds.

    Raises:
        ValueError: There are none of the same frames.
    """
    both = [name for name in poses if name in known]
    if not both:
        raise ValueError("brought_to: the maps have no frame in common")
    start, end = (np.array([some[name] for name in both]) for some in (poses, known))
    motion = fit_rigid_motion(start, end, ARM_M)
    return {name: motion @ pose for name, pose in poses.items()}


def content_of(path: Path) -> str:
    """SHA-256 of a file, or of all files of a folder with their paths in it.

    Raises:
        OSError: One cannot be read.
    """
    files = sorted(one for one in path.rglob("*") if one.is_file()) if path.is_dir() else [path]
    result = hashlib.sha256()
    for one in files:
        with one.open("rb") as file:
            of_file = hashlib.file_digest(file, "sha256").hexdigest()
        result.update(f"{one.relative_to(path).as_posix()} {of_file}\n".encode())
    return result.hexdigest()


def _reporting(tell: Tell) -> Callable[[Progress], None]:
    told = 0.0

    def report(progress: Progress) -> None:
        nonlocal told
        share = min(1.0, progress.share)
        tell(ROOM_S * (share - told))
        told = share

    return report
