"""Simulated homes of the benchmarks: recorded by the robot and mapped, once for all of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from gslts.datasets import open_dataset
from gslts.mapping.config import PRESETS, MappingConfig
from gslts.mapping.engine import make_map
from gslts.mapping.report.summary import write_result
from gslts_bench.cache import cached_folder, code_digest, native_digest
from gslts_sim import ROOM_TYPES
from gslts_sim.actions import ChangeAction, SceneState
from gslts_sim.capture import capture
from gslts_sim.change_sampler import TaskSettings
from gslts_sim.controller import Controller
from gslts_sim.explore import explore
from gslts_sim.home import Home
from gslts_sim.home_source import FileSource, HomeSource
from gslts_sim.procedural.homes import HOME_TYPES, make_home
from gslts_sim.task import Task
from gslts_sim.tasks import TaskMaker

SPLITS = {
    "development": range(5_000),
    "validation": range(5_000, 10_000),
    "test": range(10_000, 20_000),
}
"""Seeds of homes by purpose: to develop on, to choose and set thresholds on, to report on once."""


@dataclass(frozen=True)
class HomeSetup:
    """Settings that all homes of a run have in common.

    Attributes:
        frames: Maximum number of frames of a recording.
        width, height: Size of the images, px.
        noise: Preset of the sensor's noise.
        mapping: Settings of the mapping.
        code: Digests of the code that makes recordings and maps; taken before any process starts,
            as sources may be edited while they run.
    """

    frames: int = 200
    width: int = 640
    height: int = 480
    noise: str = "kinect"
    mapping: MappingConfig = field(default_factory=lambda: PRESETS["fast"])
    code: dict[str, Any] = field(default_factory=lambda: _code())

    @property
    def setting(self) -> TaskSettings:
        """Noise and image size, as makers of tasks need them."""
        return TaskSettings(noise=self.noise, width=self.width, height=self.height)


@dataclass(frozen=True)
class BenchHome:
    """A home in its default state, which its map shows.

    Attributes:
        room_type: One of `ROOM_TYPES`; of a foreign home, the name of its file.
        seed: Seed of the home and of its tasks; of a foreign home, of its tasks only.
        setup: Settings common to all homes.
        work: Folder where everything made is kept.
        file: File of a foreign home, relative to the current folder; None for ours.
    """

    room_type: str
    seed: int
    setup: HomeSetup
    work: Path
    file: FileSource | None = field(default=None, kw_only=True)

    @property
    def name(self) -> str:
        """Room type and seed, such as `kitchen_3`."""
        return f"{self.room_type}_{self.seed}"

    @property
    def recorded_of(self) -> dict[str, Any]:
        """JSON values that decide its recording."""
        setup = self.setup
        foreign = {} if self.file is None else {"sha256": self.file.sha256}
        return {
            "home": self.name,
            **foreign,
            "frames": setup.frames,
            "size": [setup.width, setup.height],
            "noise": setup.noise,
            "code": setup.code["sim"],
        }

    @property
    def mapped_of(self) -> dict[str, Any]:
        """JSON values that decide its map; the number of threads is not among them."""
        return {
            "recording": self.recorded_of,
            "mapping": self.setup.mapping.model_dump(exclude={"threads"}),
            "code": self.setup.code["map"],
        }

    def tasks(self, count: int) -> list[Task]:
        """Make tasks; the default state before them does not depend on their number.

        Args:
            count: Maximum number.

        Returns:
            At least one task.

        Raises:
            ValueError: The home gives none.
        """
        source: HomeSource | FileSource
        if self.file is None:
            source, home = HomeSource.of_seed(self.room_type, self.seed)
        else:
            source, home = self.file, self.load()
        maker = TaskMaker(self.setup.setting, self.seed)
        tasks = maker.make(source, home, count)
        if not tasks:
            reason = next(iter(maker.rejected), "nothing can be changed")
            raise ValueError(f"{self.name}: there is no task: {reason}")
        return tasks

    def load(self) -> Home:
        """Make or read the home, with all its objects.

        Raises:
            OSError: The file of a foreign home cannot be read.
            ValueError: It is another one than at the start of the run.
        """
        if self.file is None:
            return make_home(self.room_type, self.seed)
        return self.file.load(Path())

    def default_state(self, initial_actions: Iterable[ChangeAction] | None = None) -> SceneState:
        """Return the home as its map shows it.

        Args:
            initial_actions: Actions that lead to it; None takes them from a task.

        Raises:
            ChangeError: An action cannot be done.
            OSError, ValueError: See `load` and `tasks`.
        """
        if initial_actions is None:
            initial_actions = self.tasks(1)[0].initial_actions
        return SceneState(self.load()).apply_all(initial_actions)

    def recording(self) -> Path:
        """Return the folder of its recording; record it if it is missing."""

        def make(folder: Path) -> None:
            task = self.tasks(1)[0]
            robot = Controller(
                self.default_state(task.initial_actions),
                width=self.setup.width,
                height=self.setup.height,
                noise=self.setup.noise,
                seed=task.sensor.seed_before,
            )
            viewpoints, _ = explore(robot.home, self.setup.frames)
            capture(robot, viewpoints, folder)

        return cached_folder(self.work / "recordings" / self.name, self.recorded_of, make)

    def map(self) -> Path:
        """Return the folder of its map; make it on one thread if it is missing."""

        def make(folder: Path) -> None:
            dataset = open_dataset(self.recording())
            config = self.setup.mapping.model_copy(update={"threads": 1})
            write_result(folder, make_map(dataset, config), dataset.name)

        return cached_folder(self.work / "maps" / self.name, self.mapped_of, make)


def homes_of(
    seeds: range, room_types: Sequence[str], setup: HomeSetup, work: Path
) -> list[BenchHome]:
    """List the homes of some room types for each seed.

    Args:
        seeds: Seeds of one split.
        room_types: Some of `HOME_TYPES`, each once; empty for those of a single room.
        setup: Settings common to all homes.
        work: Folder where everything made is kept.

    Returns:
        Homes by seed, then room type.

    Raises:
        ValueError: A room type does not exist or is named twice, or the seeds mix splits.
    """
    split_of(seeds)
    room_types = room_types or list(ROOM_TYPES)
    if not set(room_types) <= set(HOME_TYPES) or len(set(room_types)) < len(room_types):
        known, got = ", ".join(HOME_TYPES), ", ".join(room_types)
        raise ValueError(f"room types: expected some of {known}, each once, got {got}")
    return [BenchHome(room_type, seed, setup, work) for seed in seeds for room_type in room_types]


def foreign_homes_of(
    files: Sequence[Path], seeds: range, setup: HomeSetup, work: Path
) -> list[BenchHome]:
    """List the homes of some files for each seed of tasks.

    Args:
        files: GLB files of different names.
        seeds: Seeds of the tasks; each withholds other objects from the home, and has its own map.
        setup: Settings common to all homes.
        work: Folder where everything made is kept.

    Returns:
        Homes by file, then seed.

    Raises:
        OSError: A file cannot be read.
        ValueError: A file is not a home, or two have the same name.
    """
    if len({path.name for path in files}) < len(files):
        got = ", ".join(map(str, files))
        raise ValueError(f"--home: expected files of different names, got {got}")
    sources = {path.name: FileSource.of_path(path, Path())[0] for path in files}
    return [
        BenchHome(name, seed, setup, work, file=source)
        for name, source in sources.items()
        for seed in seeds
    ]


def movable_types(home: Home) -> list[str]:
    """List the types of movable objects, which a foreign home is asked for.

    Args:
        home: The home.
    """
    return sorted({obj.type for obj in home.objects if obj.movable})


def split_of(seeds: range) -> str:
    """Return the split of `SPLITS` that all seeds are in.

    Args:
        seeds: Seeds of homes; not empty.

    Returns:
        Name of the split.

    Raises:
        ValueError: The seeds are in more than one split, or in none.
    """
    for name, split in SPLITS.items():
        if seeds[0] in split and seeds[-1] in split:
            return name
    splits = ", ".join(
        f"{name} {seeds_of[0]} to {seeds_of[-1]}" for name, seeds_of in SPLITS.items()
    )
    raise ValueError(
        f"--seeds: {seeds[0]} to {seeds[-1]} are not of one split, and results of different splits "
        f"belong in different tables; the splits are {splits}"
    )


def even_shares(count: int, homes: int) -> list[int]:
    """Spread a number of cases evenly over homes.

    Args:
        count: Number of cases.
        homes: Number of homes, at least 1.

    Returns:
        Number of cases of each home; the first ones get one more where it does not divide.
    """
    return [count // homes + (number < count % homes) for number in range(homes)]


def _code() -> dict[str, Any]:
    libraries = {}
    for name in ("numpy", "embreex"):
        with suppress(PackageNotFoundError):  # The simulator is an extra.
            libraries[name] = version(name)
    recorded, native = code_digest("gslts_bench.homes", without=("gslts.mapping",)), native_digest()
    return {
        "sim": {"python": recorded, "native": native, "libraries": libraries},
        "map": {"python": code_digest("gslts_bench.homes"), "native": native},
    }
