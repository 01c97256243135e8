"""The benchmark of change detection: homes, cases and detectors, to numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from gslts import __version__
from gslts.io.atomic_files import empty_folder
from gslts_bench.detection.cases import counts_of
from gslts_bench.detection.pictures import PictureUnit, chosen_of
from gslts_bench.detection.run import DetectUnit, Record
from gslts_bench.detection.tables import summary
from gslts_bench.detection.variants import STRATEGIES, VARIANTS
from gslts_bench.detection.watch import WATCH
from gslts_bench.homes import BenchHome
from gslts_bench.work import run_for_records, run_units


@dataclass(frozen=True, eq=False)
class Outcome:
    """What the benchmark found.

    Attributes:
        records: One for each case and detector.
        failed: Homes in which nothing could be asked, and why.
        missing: Single changes that the homes did not give, of those asked for.
    """

    records: tuple[Record, ...]
    failed: dict[str, str]
    missing: int

    @property
    def errors(self) -> dict[str, str]:
        """Cases and homes that errored, and why."""
        of_cases = {one.case: one.error for one in self.records if one.error is not None}
        return {**of_cases, **self.failed}

    def summaries(self) -> dict[str, dict[str, Any]]:
        """The numbers of each detector that was asked."""
        asked = {one.variant for one in self.records} | set(STRATEGIES)
        return {name: summary(self.records, name) for name in (*VARIANTS, WATCH) if name in asked}


def units_of(homes: Sequence[BenchHome], tasks: int, *, trade: bool) -> list[DetectUnit]:
    """The work, for so many single changes in all."""
    counts = counts_of(tasks, len(homes))
    return [DetectUnit(home, one, trade) for home, one in zip(homes, counts, strict=True)]


def measure(units: Sequence[DetectUnit], jobs: int, bar: Any) -> Outcome:
    """Does what was not done yet; see `run_for_records`."""
    records, failed = run_for_records(units, jobs, bar)
    wanted = sum(unit.counts.single for unit in units if unit.name not in failed)
    made = {one.case for one in records if one.part == "single"}
    return Outcome(tuple(records), failed, max(0, wanted - len(made)))


def draw(
    units: Sequence[DetectUnit], outcome: Outcome, folder: Path, jobs: int, bar: Any
) -> dict[str, str]:
    """Writes overlays of what the default detector got right and wrong.

    Returns:
        Homes in which it failed, and why.

    Raises:
        OSError: They cannot be written.
        ValueError: The folder is not empty.
    """
    empty_folder(folder)
    variant = next(iter(STRATEGIES))
    chosen = chosen_of(outcome.records, variant)
    work = [
        PictureUnit(unit, own, folder)
        for unit in units
        if (own := tuple(one for one in chosen if one.case.startswith(f"{unit.name}/")))
    ]
    found = run_units(work, jobs, bar)
    return {name: results[-1]["error"] for name, results in found.items() if results}


def told(units: Sequence[DetectUnit], outcome: Outcome) -> dict[str, Any]:
    """Everything, in values of JSON."""
    return {
        "gslts": __version__,
        "homes": {
            unit.name: {
                "made_of": unit.bench.mapped_of,
                "counts": asdict(unit.counts),
                "results": unit.results.name,
            }
            for unit in units
        },
        "summaries": outcome.summaries(),
        "errors": outcome.errors,
        "missing": outcome.missing,
        "records": [record.model_dump(mode="json") for record in outcome.records],
    }
