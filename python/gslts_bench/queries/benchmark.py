"""The benchmark of localisation: homes and ways to teach their maps, to numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from gslts import __version__
from gslts_bench.homes import BenchHome
from gslts_bench.queries.run import ABLATION, OURS, TRADE, LocalizeUnit, Record, Variant
from gslts_bench.queries.tables import summary
from gslts_bench.work import run_for_records


@dataclass(frozen=True, eq=False)
class Outcome:
    """What the benchmark found.

    Attributes:
        records: One for each home and variant.
        errors: Homes and variants without a result, and why.
    """

    records: tuple[Record, ...]
    errors: dict[str, str]


def units_of(homes: Sequence[BenchHome], *, trade: bool, ablation: bool) -> list[LocalizeUnit]:
    """The work; `trade` asks with codes of other lengths, `ablation` with less of everything."""
    variants = {OURS: Variant(), **(TRADE if trade else {}), **(ABLATION if ablation else {})}
    return [LocalizeUnit(home, variants) for home in homes]


def measure(units: Sequence[LocalizeUnit], jobs: int, bar: Any) -> Outcome:
    """Does what was not done yet; see `run_for_records`."""
    records, failed = run_for_records(units, jobs, bar)
    errors = {f"{one.home}, {one.variant}": one.error for one in records if one.error is not None}
    good = tuple(one for one in records if one.error is None)
    return Outcome(good, {**errors, **failed})


def told(units: Sequence[LocalizeUnit], outcome: Outcome) -> dict[str, Any]:
    """Everything, in values of JSON."""
    return {
        "gslts": __version__,
        "homes": {unit.name: unit.bench.mapped_of for unit in units},
        "summary": summary(outcome.records),
        "errors": outcome.errors,
        "records": [record.model_dump(mode="json") for record in outcome.records],
    }
