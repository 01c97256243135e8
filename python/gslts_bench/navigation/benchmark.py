"""The benchmark of navigation to objects: homes and episodes, to numbers."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gslts import __version__
from gslts_bench.homes import BenchHome, shares_of
from gslts_bench.navigation.moved import MovedUnit
from gslts_bench.navigation.run import NavigateUnit, Record
from gslts_bench.navigation.tables import summary
from gslts_bench.work import run_for_records


@dataclass(frozen=True, eq=False)
class Outcome:
    """What the benchmark found.

    Attributes:
        records: One for each episode.
        failed: Homes in which nothing could be tried, and why.
    """

    records: tuple[Record, ...]
    failed: dict[str, str]

    @property
    def errors(self) -> dict[str, str]:
        """Episodes and homes that errored, and why."""
        of_episodes = {one.id: one.error for one in self.records if one.error is not None}
        return {**of_episodes, **self.failed}


Unit = NavigateUnit | MovedUnit


def units_of(homes: Sequence[BenchHome], episodes: int, moved: int) -> list[Unit]:
    """The work, for so many episodes in all, and relocations of so many objects."""
    shares = shares_of(episodes, len(homes)), shares_of(moved, len(homes))
    units: list[Unit] = []
    for home, count, tasks in zip(homes, *shares, strict=True):
        units += [NavigateUnit(home, count)] if count else []
        units += [MovedUnit(home, tasks)] if tasks else []
    return units


def measure(units: Sequence[Unit], jobs: int, bar: Any) -> Outcome:
    """Does what was not done yet; see `run_for_records`."""
    records, failed = run_for_records(units, jobs, bar)
    return Outcome(tuple(sorted(records, key=lambda one: one.id)), failed)


def copy_pictures(units: Sequence[Unit], outcome: Outcome, folder: Path) -> int:
    """Copies the picture of each episode to a folder; how many there are.

    Raises:
        OSError: One cannot be written.
    """
    count = 0
    for record in outcome.records:
        places = [
            unit.picture(record.id) for unit in units if record.id.startswith(unit.bench.name)
        ]
        for path in filter(Path.is_file, places):
            end = "reached" if record.success else "failed"
            shutil.copyfile(path, folder / f"{path.stem}_{record.category}_{end}.png")
            count += 1
    return count


def told(units: Sequence[Unit], outcome: Outcome) -> dict[str, Any]:
    """Everything, in values of JSON."""
    return {
        "gslts": __version__,
        "homes": {
            unit.name: {
                "made_of": unit.bench.mapped_of,
                "asked_for": unit.tasks if isinstance(unit, MovedUnit) else unit.episodes,
                "results": unit.results.name,
            }
            for unit in units
        },
        "summary": summary(outcome.records),
        "errors": outcome.errors,
        "records": [
            {**record.model_dump(mode="json"), "spl": record.spl} for record in outcome.records
        ],
    }
