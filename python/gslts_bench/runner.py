"""Runner of all benchmarks: units of work, their records, and the result as tables and JSON."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, Generic, Protocol, TypeVar, cast

from pydantic import BaseModel

from gslts.fleet.jobs import Add, Jobs, Result, message_of, run_units
from gslts_bench.cache import code_digest, digest, native_digest
from gslts_bench.provenance import describe_run
from gslts_bench.tables import Table, result_markdown
from gslts_sim.strict_model import STRICT


class BenchRecord(BaseModel):
    """Result of one case.

    Attributes:
        id: Identifies it within its unit.
        error: Reason if there is no result; the other values then mean nothing.
    """

    model_config = STRICT

    id: str
    error: str | None = None

    def as_json(self) -> dict[str, Any]:
        """Return the record as JSON values for the result of a run."""
        return self.model_dump(mode="json")


class Subject(Protocol):
    """A home or a recorded room, whose maps a benchmark works on.

    Attributes:
        name: Name, unique within a run.
        work: Folder where everything made is kept.
        mapped_of: JSON values that decide its map.
    """

    @property
    def name(self) -> str: ...  # noqa: D102

    @property
    def work(self) -> Path: ...  # noqa: D102

    @property
    def mapped_of(self) -> dict[str, Any]: ...  # noqa: D102


R = TypeVar("R", bound=BenchRecord)
"""Type of a benchmark's records."""
S = TypeVar("S", bound=Subject)
"""Type of a benchmark's subjects."""


@dataclass(frozen=True)
class BenchUnit(Generic[R, S]):
    """Work of a benchmark on one subject; a benchmark defines `record`, `run` and `count`.

    Attributes:
        bench: The home or room.
    """

    bench: S

    topic: ClassVar[str]
    """Folder of the results."""
    record: ClassVar[type[BenchRecord]]
    """Model of the results."""

    @property
    def name(self) -> str:
        """Name of the subject."""
        return self.bench.name

    @property
    def count(self) -> int:
        """Number of results when all is done."""
        raise NotImplementedError

    def run(self, done: frozenset[str], add: Add) -> None:
        """Compute the results that are missing; see `Unit`.

        Args:
            done: Ids of the results of earlier runs.
            add: Receives each new result.
        """
        raise NotImplementedError

    def is_asked(self, record: R) -> bool:  # noqa: ARG002
        """Return whether this run asks for a record; a file may hold more than it does.

        Args:
            record: A record in the file of results.
        """
        return True

    def count_missing(self, records: Sequence[R]) -> int:  # noqa: ARG002
        """Return how many of the cases that were asked for do not exist.

        Args:
            records: Records that are asked for, with errors.
        """
        return 0

    @property
    def settings(self) -> dict[str, Any]:
        """JSON values that decide the results besides map and code."""
        return {}

    @cached_property
    def code(self) -> dict[str, Any]:
        """Digests of the code that decides the results; taken before processes start."""
        return {"python": code_digest(type(self).__module__), "native": native_digest()}

    @cached_property
    def results(self) -> Path | None:
        """File of the records; another one when anything that decides them is another."""
        key = {"map": self.bench.mapped_of, "code": self.code, **self.settings}
        return self.bench.work / self.topic / f"{self.name}_{digest(key)}.jsonl"

    def image(self, case: str) -> Path:
        """Return the file for an image of a case, beside the results.

        Args:
            case: Name of the case.
        """
        assert self.results is not None
        return self.results.with_suffix("") / f"{case.replace('/', '_')}.png"

    def record_of(self, result: Result) -> R:
        """Validate a result.

        Args:
            result: JSON values of a result.

        Raises:
            ValueError: It is no record of this benchmark.
        """
        try:
            return cast(R, self.record.model_validate_json(json.dumps(result)))
        except ValueError:
            name = f"{self.results}: {result['id']}"
            raise ValueError(f"{name}: this is no result; remove the file") from None


@dataclass(frozen=True, eq=False)
class Outcome(Generic[R]):
    """Everything that a run of a benchmark found.

    Attributes:
        records: Those without error, in the order of the units.
        errors: Reason by id of the case or name of the unit that failed.
        missing: Number of cases that the homes did not give.
        summary: Numbers of the records, JSON values.
    """

    records: tuple[R, ...]
    errors: dict[str, str]
    missing: int
    summary: dict[str, Any]


@dataclass(frozen=True)
class Benchmark(Generic[R]):
    """A topic: how its records become numbers and tables.

    Attributes:
        title: Heading of its result.
        doing: Word for the progress bar.
        summarize: Computes the numbers of records, JSON values.
        tabulate: Makes tables of these numbers.
    """

    title: str
    doing: str
    summarize: Callable[[Sequence[R]], dict[str, Any]]
    tabulate: Callable[[Mapping[str, Any]], list[Table]]

    def measure(self, units: Sequence[BenchUnit[R, Any]], jobs: Jobs, bar: Any) -> Outcome[R]:
        """Do what is left of all units and summarize all records that are asked for.

        Args:
            units: Units of different names.
            jobs: Workers.
            bar: Progress bar; see `run_units`.

        Returns:
            The outcome.

        Raises:
            ImportError, OSError, RuntimeError, ValueError: See `run_units`.
        """
        found = run_units(units, jobs, bar)
        records: list[R] = []
        errors: dict[str, str] = {}
        missing = 0
        for unit in units:
            failed = [result for result in found[unit.name] if result["id"] == unit.name]
            errors.update((result["id"], result["error"]) for result in failed)
            own = [unit.record_of(result) for result in found[unit.name] if result not in failed]
            own = [record for record in own if unit.is_asked(record)]
            missing += 0 if failed else max(0, unit.count_missing(own))
            errors |= {record.id: record.error for record in own if record.error is not None}
            records += [record for record in own if record.error is None]
        return Outcome(tuple(records), errors, missing, self.summarize(records))

    def result(
        self, units: Sequence[BenchUnit[R, Any]], outcome: Outcome[R], homes: Mapping[str, Any]
    ) -> dict[str, Any]:
        """Collect a run as JSON values.

        Args:
            units: Units of the run.
            outcome: From `measure`.
            homes: `seeds` and `split` of the homes, or `foreign`, names of files; empty for
                recorded rooms.

        Returns:
            JSON values; `result_markdown` formats them.
        """
        return {
            "title": self.title,
            **describe_run(),
            **homes,
            "subjects": {
                unit.name: {
                    "made_of": unit.bench.mapped_of,
                    "results": None if unit.results is None else unit.results.name,
                }
                for unit in units
            },
            "cases": outcome.summary.get("cases", ""),
            "tables": [asdict(table) for table in self.tabulate(outcome.summary)],
            "summary": outcome.summary,
            "errors": outcome.errors,
            "missing": outcome.missing,
            "records": [record.as_json() for record in outcome.records],
        }

    def markdown(self, result: dict[str, Any]) -> str:
        """Format a result from `result` for people.

        Args:
            result: From `result`.
        """
        return f"## {self.title}\n\n{result_markdown(result)}"


def attempt(record: R, compute: Callable[[], Mapping[str, Any]]) -> R:
    """Complete a record, or note why that failed; other cases go on.

    Args:
        record: Record of a case, without its result.
        compute: Returns the fields of the result.

    Returns:
        The record with these fields, or with an error.
    """
    try:
        found = compute()
    except Exception as error:
        found = {"error": message_of(error)}
    return record.model_copy(update=dict(found))
