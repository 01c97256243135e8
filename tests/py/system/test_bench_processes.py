"""Units of work in several processes: results are kept as they come, and failures are isolated."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import bench_units
import pytest
from bench_units import Bar, CountingUnit
from command import LONG_S

from gslts.fleet.jobs import read_results, run_units


def squares(results: list[dict]) -> dict[str, int]:
    return {result["id"]: result["square"] for result in results if "square" in result}


def expected(name: str, count: int = 5) -> dict[str, int]:
    return {f"{name}/{k}": k**2 for k in range(count)}


def test_all_units_are_done_by_so_many_processes(tmp_path: Path) -> None:
    units = [CountingUnit(name, tmp_path / "new") for name in "abc"]
    bar = Bar()
    found = run_units(units, 2, bar)
    assert {name: squares(results) for name, results in found.items()} == {
        name: expected(name) for name in "abc"
    }
    assert len({result["process"] for results in found.values() for result in results}) == 2
    assert bar.n == bar.total == 15


def test_finished_results_are_not_computed_again(tmp_path: Path) -> None:
    half = run_units([CountingUnit("a", tmp_path, count=3)], 1, Bar())
    bar = Bar()
    found = run_units([CountingUnit("a", tmp_path, raises_at=1)], 1, bar)
    assert found["a"][:3] == half["a"]
    assert squares(found["a"]) == expected("a")
    assert bar.n == bar.total == 2


def test_a_line_that_was_cut_off_is_done_again(tmp_path: Path) -> None:
    unit = CountingUnit("a", tmp_path)
    run_units([unit], 1, Bar())
    whole = unit.results.read_bytes()
    unit.results.write_bytes(whole[:-7])
    assert len(read_results(unit.results)) == 4
    assert squares(run_units([unit], 1, Bar())["a"]) == expected("a")
    assert len(read_results(unit.results)) == 5, "the new line must not stand behind half a one"


def test_errors_are_tried_again(tmp_path: Path) -> None:
    path = tmp_path / "a.jsonl"
    path.write_text('{"id": "a/0", "error": "no luck"}\n{"id": "a/1", "square": 1}\n')
    assert [result["id"] for result in read_results(path)] == ["a/1"]


@pytest.mark.parametrize("line", ["{", "[1]", '{"square": 1}', '{"id": 1}'])
def test_other_files_are_rejected(tmp_path: Path, line: str) -> None:
    path = tmp_path / "a.jsonl"
    path.write_text(f'{{"id": "a/0"}}\n{line}\n')
    with pytest.raises(ValueError, match=r"a\.jsonl: line 2 is no result"):
        read_results(path)


@pytest.mark.parametrize(
    ("fate", "message"),
    [
        ({"raises_at": 2}, "ValueError: no such luck"),
        ({"dies_at": 2}, "its process ended with code -9"),
    ],
)
def test_a_unit_that_fails_ends_no_other(
    tmp_path: Path, fate: dict[str, int], message: str
) -> None:
    units = [CountingUnit("a", tmp_path, **fate), CountingUnit("b", tmp_path)]
    bar = Bar()
    found = run_units(units, 1, bar)
    assert found["a"][-1] == {"id": "a", "error": message}
    assert squares(found["a"]) == expected("a", 2)
    assert squares(found["b"]) == expected("b")
    assert bar.n == bar.total == 10
    assert squares(read_results(units[0].results)) == expected("a", 2)


PROGRAM = """
import signal
import sys
from pathlib import Path
sys.path.insert(0, {support!r})
from bench_units import Bar, CountingUnit
from gslts.fleet.jobs import run_units
if __name__ == "__main__":
    # What a shell runs in the background ignores it from the start.
    signal.signal(signal.SIGINT, signal.default_int_handler)
    run_units([CountingUnit("a", Path({folder!r}), waits_at=3)], 1, Bar())
"""


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT, signal.SIGTERM])
def test_a_stop_leaves_whole_results_and_no_process(tmp_path: Path, how: signal.Signals) -> None:
    program = PROGRAM.format(support=str(Path(bench_units.__file__).parent), folder=str(tmp_path))
    (tmp_path / "program.py").write_text(program)
    with subprocess.Popen(
        [sys.executable, tmp_path / "program.py"], stderr=subprocess.DEVNULL
    ) as process:
        try:
            worker = int(wait_for(lambda: [path.stem for path in tmp_path.glob("*.pid")])[0])
            # The worker may wait before the program has kept what it was sent, or even any of it.
            results = tmp_path / "a.jsonl"
            wait_for(lambda: results.exists() and results.read_bytes().count(b"\n") == 3)
            process.send_signal(how)
            process.wait(timeout=LONG_S)
        finally:
            process.kill()  # Otherwise a failure would wait for the program forever.
    wait_for(lambda: not is_alive(worker))
    found = run_units([CountingUnit("a", tmp_path)], 1, Bar())
    assert squares(found["a"]) == expected("a")
    assert [result["process"] == worker for result in found["a"]] == [True] * 3 + [False] * 2
    assert len((tmp_path / "a.jsonl").read_text().splitlines()) == 5
    json.loads((tmp_path / "a.jsonl").read_text().splitlines()[2])


def wait_for(ask):
    for _ in range(int(LONG_S / 0.05)):
        answer = ask()
        if answer:
            return answer
        time.sleep(0.05)
    raise AssertionError("it never happened")


def is_alive(process: int) -> bool:
    try:
        os.kill(process, 0)
        status = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0]
    except (ProcessLookupError, FileNotFoundError):
        return False
    return status != "Z"
