"""Homes that benchmarks run in: recorded by the robot, and mapped, once for all of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, TypeVar

from gslts.datasets import open_dataset
from gslts.mapping.config import PRESETS, MappingConfig
from gslts.mapping.engine import make_map
from gslts.mapping.optimize import Progress
from gslts.mapping.report.summary import write_result
from gslts_bench.cache import cached_folder, code_digest, native_digest
from gslts_sim import ROOM_TYPES
from gslts_sim.actions import ChangeAction, SceneState
from gslts_sim.capture import capture
from gslts_sim.change_sampler import TaskSettings
from gslts_sim.controller import Controller
from gslts_sim.explore import explore
from gslts_sim.home_source import HomeSource
from gslts_sim.task import Task
from gslts_sim.tasks import TaskMaker

SIM_LIBRARIES = ("numpy", "open3d-cpu", "open3d")
"""Distributions whose version decides what a robot in a home sees."""
RECORDING_S, MAP_S = 0.35, 110.0
"""About how long a frame of a recording takes, and a map of 200 of them, for the progress."""

Item = TypeVar("Item")
Tell = Callable[[float], None]
"""Is told of work done, in the seconds that it usually takes."""


@dataclass(frozen=True)
class HomeSetup:
    """What all homes of a run have in common.

    Attributes:
        frames: Of a recording, at most.
        width, height: Of the images, px.
        noise: Preset of the sensor.
        mapping: How maps are made.
        code: Digests of the code that makes recordings and maps; taken before any process starts,
            as sources may be edited while they run.
    """

    frames: int = 200
    width: int = 640
    height: int = 480
    noise: str = "kinect"
    mapping: MappingConfig = field(default_factory=lambda: PRESETS["fast"])
    code: dict[str, Any] = field(default_factory=lambda: _code())


@dataclass(frozen=True)
class BenchHome:
    """A home in its default state, which its map shows.

    Attributes:
        room_type: Of `ROOM_TYPES`.
        seed: Of the home, and of its tasks.
        setup: Of all homes.
        work: Folder where what was made is kept.
    """

    room_type: str
    seed: int
    setup: HomeSetup
    work: Path

    @property
    def name(self) -> str:
        """Such as `kitchen_3`."""
        return f"{self.room_type}_{self.seed}"

    @property
    def recorded_of(self) -> dict[str, Any]:
        """All that decides what its recording is."""
        setup = self.setup
        return {
            "home": self.name,
            "frames": setup.frames,
            "size": [setup.width, setup.height],
            "noise": setup.noise,
            "code": setup.code["sim"],
        }

    @property
    def mapped_of(self) -> dict[str, Any]:
        """All that decides what its map is; the number of threads does not."""
        return {
            "recording": self.recorded_of,
            "mapping": self.setup.mapping.model_dump(exclude={"threads"}),
            "code": self.setup.code["map"],
        }

    def tasks(self, count: int) -> list[Task]:
        """Up to `count` tasks; the default state before them does not depend on the number.

        Raises:
            ValueError: There is not one.
        """
        setting = TaskSettings(
            noise=self.setup.noise, width=self.setup.width, height=self.setup.height
        )
        source, home = HomeSource.of_seed(self.room_type, self.seed)
        maker = TaskMaker(setting, self.seed)
        tasks = maker.make(source, home, count)
        if not tasks:
            reason = next(iter(maker.rejected), "nothing can be changed")
            raise ValueError(f"{self.name}: there is no task: {reason}")
        return tasks

    def recording(self, tell: Tell = lambda _: None) -> Path:
        """The folder of its recording, made unless it is there."""

        def make(folder: Path) -> None:
            task = self.tasks(1)[0]
            assert isinstance(task.home, HomeSource)  # As it comes from a seed.
            robot = Controller(
                default_state(task.home, task.initial_actions),
                width=self.setup.width,
                height=self.setup.height,
                noise=self.setup.noise,
                seed=task.sensor.seed_before,
            )
            looks, _ = explore(robot.home, self.setup.frames)
            capture(robot, _told(looks, lambda: tell(RECORDING_S)), folder)

        return cached_folder(self.work / "recordings" / self.name, self.recorded_of, make)

    def map(self, tell: Tell = lambda _: None) -> Path:
        """The folder of its map, made of its recording unless it is there, on one thread."""

        def make(folder: Path) -> None:
            dataset = open_dataset(self.recording(tell))
            config = self.setup.mapping.model_copy(update={"threads": 1})
            told = 0.0

            def report(progress: Progress) -> None:
                nonlocal told
                share = min(1.0, progress.share)
                tell(MAP_S * (share - told))
                told = share

            result = make_map(dataset, config, report=report)
            write_result(folder, result, dataset.name)

        return cached_folder(self.work / "maps" / self.name, self.mapped_of, make)


def homes_of(
    seeds: range, room_types: Sequence[str], setup: HomeSetup, work: Path
) -> list[BenchHome]:
    """Those of some room types for each seed; of all if none is named.

    Raises:
        ValueError: There is no such room type, or one is named twice.
    """
    room_types = room_types or list(ROOM_TYPES)
    if not set(room_types) <= set(ROOM_TYPES) or len(set(room_types)) < len(room_types):
        known, got = ", ".join(ROOM_TYPES), ", ".join(room_types)
        raise ValueError(f"room types: expected some of {known}, each once, got {got}")
    return [BenchHome(room_type, seed, setup, work) for seed in seeds for room_type in room_types]


def default_state(source: HomeSource, initial_actions: Iterable[ChangeAction]) -> SceneState:
    """A home as its map shows it.

    Raises:
        ValueError: It is another home.
        ChangeError: An action cannot be done.
    """
    return SceneState(source.load(Path())).apply_all(initial_actions)


def shares_of(count: int, homes: int) -> list[int]:
    """A number of things spread evenly over homes."""
    return [count // homes + (number < count % homes) for number in range(homes)]


def _told(items: Iterable[Item], tell: Callable[[], None]) -> Iterator[Item]:
    for item in items:
        yield item
        tell()


def _code() -> dict[str, Any]:
    libraries = {}
    for name in SIM_LIBRARIES:
        try:
            libraries[name] = version(name)
        except PackageNotFoundError:  # Open3D has two names.
            continue
    return {
        "sim": {
            "python": code_digest("gslts_bench.homes", without=("gslts.mapping",)),
            "libraries": libraries,
        },
        "map": {"python": code_digest("gslts_bench.homes"), "native": native_digest()},
    }
