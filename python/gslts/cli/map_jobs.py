"""Maps of several data sets as jobs."""

from __future__ import annotations

import io
from collections.abc import Sequence
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import typer

from gslts.cli import mapping
from gslts.cli.jobs import fail, progress_bar
from gslts.fleet.jobs import Add, Jobs, run_units


@dataclass(frozen=True)
class MapUnit:
    """The command `gslts map` for one data set.

    Attributes:
        dataset: The data set.
        out: Folder of the map.
        options: Other arguments of `mapping.make`.
        results: None: the map is the result.
        count: 1, the map.
    """

    dataset: Path
    out: Path
    options: dict[str, Any]
    results: None = None
    count: int = 1

    @property
    def name(self) -> str:
        """Path of the map."""
        return str(self.out)

    def run(self, _done: frozenset[str], add: Add) -> None:
        """Make the map, from what an interrupted run kept if there was one; see `Unit`.

        Args:
            _done: Ignored: a map that is there is done.
            add: Receives what the command printed.
        """
        said = io.StringIO()
        with redirect_stdout(said), redirect_stderr(said):
            if self.out.exists():
                typer.echo(f"{self.out} is there already")
            else:
                resume = mapping.is_interrupted(self.out)
                mapping.make([self.dataset], self.out, **self.options, resume=resume)
        add({"id": f"{self.name}: map", "said": said.getvalue()})


def make_maps(datasets: Sequence[Path], out: Path, options: dict[str, Any], jobs: Jobs) -> None:
    """Make a map of each data set, and print what was made in their order.

    Args:
        datasets: The data sets.
        out: Folder of the map of a single data set; else each gets a folder of its name there.
        options: Other arguments of `mapping.make`.
        jobs: Workers.

    Raises:
        ImportError, OSError, RuntimeError: See `run_units`; a map could not be made.
        ValueError: Two data sets have the same name.
    """
    names = [dataset.resolve().name for dataset in datasets]
    if len(set(names)) < len(names):
        raise ValueError(f"data sets need different names, got {', '.join(names)}")
    folders = [out] if len(names) == 1 else [out / name for name in names]
    units = [MapUnit(*paths, options) for paths in zip(datasets, folders, strict=True)]
    with progress_bar("maps") as bar:
        found = run_units(units, jobs, bar)
    results = [found[unit.name][-1] for unit in units]
    for result in results:
        typer.echo(result.get("said", ""), nl=False)
    fail({result["id"]: result["error"] for result in results if "error" in result})
