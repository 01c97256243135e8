"""Runner of the benchmarks: records, errors, splits of seeds, and results as JSON and tables."""

import importlib.util
import json
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from bench_units import Bar

from gslts_bench import runner
from gslts_bench.homes import SPLITS, HomeSetup, homes_of, split_of
from gslts_bench.runner import Benchmark, BenchRecord, BenchUnit, attempt
from gslts_bench.tables import Table, number, result_markdown, share

REPOSITORY = Path(__file__).parents[3]


class Record(BenchRecord):
    square: int = 0


@dataclass(frozen=True)
class Home:
    name: str
    work: Path

    @property
    def mapped_of(self) -> dict[str, Any]:
        return {"home": self.name}


@dataclass(frozen=True)
class Unit(BenchUnit[Record, Home]):
    topic = "squares"
    record = Record
    code = "that of no module"

    wanted: int = 3

    @property
    def count(self) -> int:
        return self.wanted

    def is_asked(self, record: Record) -> bool:
        return record.square < 100

    def count_missing(self, records: list[Record]) -> int:
        return self.wanted - len(records)


BENCHMARK = Benchmark(
    "Squares",
    "squaring",
    lambda records: {"sum": sum(record.square for record in records)},
    lambda found: [Table("", ("", "sum"), (("all", str(found["sum"])),), "A note.")],
)


@pytest.fixture
def outcome(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[list[Unit], Any]:
    """Two units: one with a result, an error and one result too many; one that failed."""
    results = {
        "a": [
            {"id": "a/0", "square": 4},
            {"id": "a/1", "error": "ValueError: no"},
            {"id": "a/2", "square": 144},
        ],
        "b": [{"id": "b/0", "square": 9}, {"id": "b", "error": "OSError: gone"}],
    }
    monkeypatch.setattr(runner, "run_units", lambda _units, _jobs, _bar: results)
    units = [Unit(Home(name, tmp_path)) for name in "ab"]
    return units, BENCHMARK.measure(units, 1, Bar())


def test_records_errors_and_missing_cases_are_separate(outcome: tuple[list[Unit], Any]) -> None:
    _, found = outcome
    assert [record.id for record in found.records] == ["a/0", "b/0"]
    assert found.errors == {"a/1": "ValueError: no", "b": "OSError: gone"}
    assert found.missing == 1, "of a, whose two records are asked for; b failed as a whole"
    assert found.summary == {"sum": 13}


def test_a_result_says_how_it_was_made(outcome: tuple[list[Unit], Any]) -> None:
    units, found = outcome
    result = json.loads(
        json.dumps(BENCHMARK.result(units, found, {"seeds": [0, 2], "split": "development"}))
    )
    assert result["command"]
    assert {"cpu", "cores", "instruction_set"} <= set(result["machine"])
    assert result["versions"]["numpy"]
    assert result["date"].startswith("20")
    assert "commit" in result
    assert (result["seeds"], result["split"]) == ([0, 2], "development")
    text = BENCHMARK.markdown(result)
    assert text.startswith("## Squares\n\nCommit ")
    assert "Homes with seeds 0 to 1: development split." in text
    assert "|  | sum |\n| :-- | --: |\n| all | 13 |\n\nA note." in text


def test_a_damaged_result_is_named(tmp_path: Path) -> None:
    unit = Unit(Home("a", tmp_path))
    with pytest.raises(ValueError, match=r"a_.*\.jsonl: a/0: this is no result"):
        unit.record_of({"id": "a/0", "square": "four"})


def test_settings_decide_the_file_of_results(tmp_path: Path) -> None:
    names = {Unit(Home(name, tmp_path), wanted).results for name in "ab" for wanted in (3, 4)}
    assert len(names) == 2, "the number of cases does not count"
    assert all(path is not None and path.parent == tmp_path / "squares" for path in names)


def test_a_case_that_fails_becomes_a_record_with_an_error() -> None:
    def fail() -> dict[str, Any]:
        raise ValueError("no\nluck")

    assert attempt(Record(id="a"), fail).error == "ValueError: no luck"
    assert attempt(Record(id="a"), lambda: {"square": 4}) == Record(id="a", square=4)


@pytest.mark.parametrize(
    ("seeds", "split"),
    [
        (range(5_000), "development"),
        (range(5_000, 10_000), "validation"),
        (range(10_000, 10_004), "test"),
        (range(19_999, 20_000), "test"),
    ],
)
def test_seeds_are_of_one_split(seeds: range, split: str) -> None:
    assert split_of(seeds) == split


@pytest.mark.parametrize(
    "seeds", [range(4_999, 5_001), range(9_990, 10_010), range(20_000, 20_001)]
)
def test_seeds_of_two_splits_or_of_none_are_rejected(seeds: range) -> None:
    with pytest.raises(ValueError, match=r"not of one split.*test 10000 to 19999"):
        homes_of(seeds, [], HomeSetup(code={}), Path())


def test_splits_have_no_seed_in_common() -> None:
    ordered = list(SPLITS.values())
    for before, after in pairwise(ordered):
        assert before.stop == after.start


def test_cells() -> None:
    assert share(273, 300) == "91.0 % (273 of 300)"
    assert share(0, 0) == number(None, 2) == "-"
    assert number(1.234, 1, "s") == "1.2 s"


def test_tables_are_put_into_markdown_files(
    outcome: tuple[list[Unit], Any], tmp_path: Path
) -> None:
    path = REPOSITORY / "benchmarks" / "tables.py"
    spec = importlib.util.spec_from_file_location("benchmark_tables", path)
    assert spec is not None
    assert spec.loader is not None
    tables = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tables)
    result = BENCHMARK.result(*outcome, {})
    (tmp_path / "squares.json").write_text(json.dumps(result))
    text = "Before\n<!-- tables: squares -->\nold\n<!-- end -->\nAfter\n"
    filled = tables.fill(text, tmp_path)
    assert result_markdown(result) in filled
    assert filled.startswith("Before\n")
    assert filled.endswith("After\n")
    assert "old" not in filled
    assert tables.fill(filled, tmp_path) == filled
    (tmp_path / "squares.json").write_text("{}")
    with pytest.raises(ValueError, match=r"squares\.json: this is no result"):
        tables.fill(text, tmp_path)
