"""The benchmark of updates: homes, tasks and methods, to numbers."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gslts import __version__
from gslts_bench.homes import BenchHome, shares_of
from gslts_bench.update.run import Record, UpdateUnit
from gslts_bench.update.tables import summary
from gslts_bench.work import run_for_records


@dataclass(frozen=True, eq=False)
class Outcome:
    """What the benchmark found.

    Attributes:
        records: One for each task and method.
        failed: Homes in which nothing could be tried, and why.
        missing: Tasks that the homes did not give, of those asked for.
    """

    records: tuple[Record, ...]
    failed: dict[str, str]
    missing: int

    @property
    def errors(self) -> dict[str, str]:
        """Tasks and homes that errored, and why."""
        of_tasks = {one.task: one.error for one in self.records if one.error is not None}
        return {**of_tasks, **self.failed}


def units_of(
    homes: Sequence[BenchHome],
    tasks: int,
    *,
    ablation: bool,
    curves: int,
    lpips: tuple[Path, Path] | None,
    threads: int,
) -> list[UpdateUnit]:
    """The work, for so many tasks in all, and curves of so many of them."""
    shares = zip(homes, shares_of(tasks, len(homes)), shares_of(curves, len(homes)), strict=True)
    return [
        UpdateUnit(home, count, ablation, drawn, lpips, threads) for home, count, drawn in shares
    ]


def measure(units: Sequence[UpdateUnit], jobs: int, bar: Any) -> Outcome:
    """Does what was not done yet; see `run_for_records`."""
    records, failed = run_for_records(units, jobs, bar)
    wanted = sum(unit.tasks for unit in units if unit.name not in failed)
    return Outcome(tuple(records), failed, max(0, wanted - len({one.task for one in records})))


def copy_pictures(units: Sequence[UpdateUnit], outcome: Outcome, folder: Path) -> int:
    """Copies the picture of each task that was updated to a folder; how many there are.

    Raises:
        OSError: One cannot be written.
    """
    count = 0
    for unit in units:
        tasks = sorted(
            {one.task for one in outcome.records if one.task.startswith(f"{unit.name}/")}
        )
        kinds = {one.task: one.kind for one in outcome.records}
        for task in tasks:
            path = unit.picture(task)
            if path.is_file():
                shutil.copyfile(path, folder / f"{path.stem}_{kinds[task]}.png")
                count += 1
    return count


def told(units: Sequence[UpdateUnit], outcome: Outcome) -> dict[str, Any]:
    """Everything, in values of JSON."""
    return {
        "gslts": __version__,
        "homes": {
            unit.name: {
                "made_of": unit.bench.mapped_of,
                "tasks": unit.tasks,
                "results": unit.results.name,
            }
            for unit in units
        },
        "summary": summary(outcome.records),
        "errors": outcome.errors,
        "missing": outcome.missing,
        "records": [record.model_dump(mode="json") for record in outcome.records],
    }
