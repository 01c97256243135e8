"""Options that all benchmarks on homes have, and the run of a benchmark with them."""

from __future__ import annotations

import inspect
import json
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

import typer

from gslts.cli.jobs import NumberOfJobs, Scheduler, fail, progress_bar, workers_of
from gslts.cli.mapping import Preset

if TYPE_CHECKING:
    from gslts_bench.homes import BenchHome, HomeSetup
    from gslts_bench.runner import Benchmark, BenchRecord, BenchUnit, Outcome

    R = TypeVar("R", bound=BenchRecord)

# What a command needs is imported inside it, so that `gslts --help` answers at once.


@dataclass(frozen=True)
class HomeOptions:
    """Options common to all benchmarks on homes; see the help texts."""

    seeds: Annotated[
        str,
        typer.Option(
            metavar="A:B",
            help="Seeds of homes, without B; each gives a kitchen, a living room and a bedroom. "
            "Below 5000 they are for development, below 10000 for validation, below 20000 for "
            "tests; a run uses one of these.",
        ),
    ] = "0:4"
    room: Annotated[
        list[str] | None,
        typer.Option("--room", help="Room type instead of all three; may be repeated."),
    ] = None
    home: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="FILE.glb",
            help="Foreign home, a glTF file, instead of ours; may be repeated. --seeds then gives "
            "the seeds of the tasks: each withholds other objects, and has a map of its own.",
        ),
    ] = None
    jobs: NumberOfJobs = None
    scheduler: Scheduler = None
    json_path: Annotated[
        Path | None, typer.Option("--json", help="File for the complete result.")
    ] = None
    work: Annotated[
        Path, typer.Option(help="Folder of recordings, maps and results, which are reused.")
    ] = Path("out/bench")
    preset: Annotated[Preset, typer.Option(help="Preset of the mapping.")] = Preset.BALANCED
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="Mapping setting, as for gslts map."),
    ] = None
    frames: Annotated[int, typer.Option(min=9, help="Maximum number of frames of a recording.")] = (
        200
    )
    size: Annotated[str, typer.Option(metavar="WxH", help="Size of the images, px.")] = "640x480"

    @property
    def seed_range(self) -> range:
        """Seeds of the homes.

        Raises:
            ValueError: The option is no range, or an empty one.
        """
        first, _, end = self.seeds.partition(":")
        if not (first.isdecimal() and end.isdecimal() and int(first) < int(end)):
            raise ValueError(f"--seeds: expected A:B with 0 <= A < B, got {self.seeds!r}")
        return range(int(first), int(end))

    @property
    def workers(self) -> int | str:
        """Workers of the jobs; see `workers_of`."""
        return workers_of(self.jobs, self.scheduler)

    @property
    def setup(self) -> HomeSetup:
        """Settings of the homes.

        Raises:
            ValueError: A setting does not exist, or the size is none.
        """
        from gslts.mapping.config import PRESETS
        from gslts_bench.homes import HomeSetup

        width, _, height = self.size.partition("x")
        sides = (width, height)
        if not all(side.isdecimal() and 16 <= int(side) <= 4096 for side in sides):
            raise ValueError(f"--size: expected WxH, each from 16 to 4096, got {self.size!r}")
        mapping = PRESETS[self.preset].with_settings(self.settings or [])
        return HomeSetup(self.frames, int(width), int(height), mapping=mapping)

    def homes(self) -> list[BenchHome]:
        """List the homes.

        Raises:
            OSError, ValueError: An option is wrong; see `homes_of` and `foreign_homes_of`.
        """
        from gslts_bench.homes import foreign_homes_of, homes_of

        if self.home and self.room:
            raise ValueError("--home and --room exclude each other: room types are those of ours")
        if self.home:
            return foreign_homes_of(self.home, self.seed_range, self.setup, self.work)
        return homes_of(self.seed_range, self.room or [], self.setup, self.work)

    def prepare(self, images: Path | None = None, *files: Path | None) -> None:
        """Check before hours of work that outputs can be written.

        Args:
            images: New or empty folder; made.
            files: Files to be written at the end, besides the JSON.

        Raises:
            OSError: An output cannot be written.
            ValueError: The folder of images is not empty.
        """
        from gslts.io.atomic_files import empty_folder

        for path in filter(None, (self.json_path, *files)):
            path.parent.mkdir(parents=True, exist_ok=True)
            if path.is_dir():
                raise IsADirectoryError(f"{path} is a folder")
            if not os.access(path.parent, os.W_OK):
                raise PermissionError(f"{path}: its folder cannot be written to")
        if images is not None:
            empty_folder(images)
        self.work.mkdir(parents=True, exist_ok=True)

    def run(
        self, benchmark: Benchmark[R], units: Sequence[BenchUnit[R, Any]], *, on_homes: bool = True
    ) -> Outcome[R]:
        """Run a benchmark, print its tables and write its JSON.

        Args:
            benchmark: The topic.
            units: Its work.
            on_homes: Whether it runs on homes with seeds.

        Raises:
            OSError: A result cannot be read or written.
            ValueError: A file of results is damaged.
        """
        from gslts.io.atomic_files import write_atomic
        from gslts_bench.homes import split_of

        with progress_bar(benchmark.doing) as bar:
            outcome = benchmark.measure(units, self.workers, bar)
        homes: dict[str, Any] = {}
        if on_homes:
            seeds = self.seed_range
            homes = {"seeds": [seeds.start, seeds.stop]}
            if self.home:
                homes["foreign"] = [path.name for path in self.home]
            else:
                homes["split"] = split_of(seeds)
        result = benchmark.result(units, outcome, homes)
        typer.echo(benchmark.markdown(result))
        if self.json_path is not None:
            write_atomic(self.json_path, (json.dumps(result, indent=1) + "\n").encode())
        return outcome


def on_homes(**defaults: Any) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Make a decorator that gives a command the options of `HomeOptions`.

    Args:
        defaults: Other defaults of these options.

    Returns:
        The decorator; the command receives the options as its first argument.
    """

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        own = list(inspect.signature(command, eval_str=True).parameters.values())[1:]
        common = [
            parameter.replace(default=defaults.get(name, parameter.default), kind=KEYWORD)
            for name, parameter in inspect.signature(HomeOptions, eval_str=True).parameters.items()
        ]

        def call(**arguments: Any) -> None:
            names = [parameter.name for parameter in common]
            options = HomeOptions(**{name: arguments.pop(name) for name in names})
            command(options, **arguments)

        parameters = [*common, *(parameter.replace(kind=KEYWORD) for parameter in own)]
        call.__name__, call.__doc__ = command.__name__, command.__doc__
        call.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
        call.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
        return call

    return decorate


KEYWORD = inspect.Parameter.KEYWORD_ONLY
"""Kind of the parameters of commands, which typer passes by name."""


def finish(errors: dict[str, str], missing: int = 0, tasks: int = 0) -> None:
    """End a benchmark.

    Args:
        errors: Reason by id of the case or name of the unit that failed.
        missing: Number of tasks that the homes did not give.
        tasks: Number of tasks that were asked for.

    Raises:
        RuntimeError: Some of it failed or is missing.
    """
    fail(errors)
    if missing:
        raise RuntimeError(f"the homes gave {tasks - missing} of {tasks} tasks")
