"""Units of work on a Dask scheduler and on a cluster of this machine."""

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bench_units
import psutil
import pytest
from bench_units import Bar, CountingUnit, UnkeptUnit
from command import LONG_S, gslts
from distributed import LocalCluster

import gslts as package
from gslts.fleet import jobs
from gslts.fleet.jobs import read_results, run_units

LOOPBACK: dict[str, Any] = {"host": "127.0.0.1", "dashboard_address": "127.0.0.1:0"}


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    """The address of a scheduler with two workers."""
    with LocalCluster(n_workers=2, threads_per_worker=1, **LOOPBACK) as cluster:
        yield cluster.scheduler_address


def squares(results: list[dict]) -> dict[str, int]:
    return {result["id"]: result["square"] for result in results if "square" in result}


def expected(name: str, count: int = 5) -> dict[str, int]:
    return {f"{name}/{k}": k**2 for k in range(count)}


def without_process(results: list[dict]) -> list[dict]:
    return [{**result, "process": None} for result in results]


def test_units_are_done_by_all_workers_as_by_one_process(scheduler: str, tmp_path: Path) -> None:
    units = [CountingUnit(name, tmp_path / "new") for name in "abc"]
    bar = Bar()
    found = run_units(units, scheduler, bar)
    for unit in units:
        alone: list[dict] = []
        unit.run(frozenset(), alone.append)
        assert without_process(found[unit.name]) == without_process(alone)
        assert found[unit.name] == read_results(unit.results)
    assert bar.n == bar.total == 15


def test_a_cluster_of_this_machine_is_loopback_only_and_has_no_pages() -> None:
    before = listening()
    with jobs._local_cluster(2) as cluster:
        opened = listening() - before
        assert len(opened) >= 3, "the scheduler and two workers"
        assert {address for address, _ in opened} == {"127.0.0.1"}
        assert cluster.scheduler_address.startswith("tls://")
        assert len(cluster.workers) == 2
        with socket.create_connection(("127.0.0.1", cluster.scheduler.http_server.port)) as http:
            http.sendall(b"GET /health HTTP/1.0\r\n\r\n")
            assert b" 404 " in http.recv(100)
    assert not listening() - before


def listening() -> set[tuple[str, int]]:
    """Addresses and ports on which this process and its children wait for connections."""
    own = psutil.Process()
    return {
        tuple(socket.laddr)
        for process in (own, *own.children())
        for socket in process.net_connections()
        if socket.status == psutil.CONN_LISTEN
    }


def test_finished_results_are_not_computed_again(scheduler: str, tmp_path: Path) -> None:
    half = run_units([CountingUnit("a", tmp_path, count=3)], scheduler, Bar())
    bar = Bar()
    found = run_units([CountingUnit("a", tmp_path, raises_at=1)], scheduler, bar)
    assert found["a"][:3] == half["a"]
    assert squares(found["a"]) == expected("a")
    assert bar.n == bar.total == 2


def test_a_line_that_was_cut_off_is_done_again(scheduler: str, tmp_path: Path) -> None:
    unit = CountingUnit("a", tmp_path)
    run_units([unit], scheduler, Bar())
    whole = unit.results.read_bytes()
    unit.results.write_bytes(whole[:-7])
    assert len(read_results(unit.results)) == 4
    assert squares(run_units([unit], scheduler, Bar())["a"]) == expected("a")
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


def test_a_unit_that_fails_ends_no_other(scheduler: str, tmp_path: Path) -> None:
    units = [CountingUnit("a", tmp_path, raises_at=2), CountingUnit("b", tmp_path)]
    bar = Bar()
    found = run_units(units, scheduler, bar)
    assert found["a"][-1] == {"id": "a", "error": "ValueError: no such luck"}
    assert squares(found["a"]) == expected("a", 2)
    assert squares(found["b"]) == expected("b")
    assert bar.n == bar.total == 10
    assert squares(read_results(units[0].results)) == expected("a", 2)


def test_who_ends_each_worker_is_named_and_ends_no_other(tmp_path: Path) -> None:
    """With a single worker, the second unit waits behind the first."""
    units = [CountingUnit("a", tmp_path, dies_at=2), CountingUnit("b", tmp_path)]
    bar = Bar()
    found = run_units(units, 1, bar)
    assert found["a"][-1]["error"] == "its worker process ended in each of 4 attempts"
    assert squares(found["a"]) == expected("a", 2)
    assert squares(found["b"]) == expected("b")
    assert bar.n == bar.total == 10


def test_another_worker_continues_where_a_lost_one_was(scheduler: str, tmp_path: Path) -> None:
    units = [CountingUnit("a", tmp_path, dies_at=2, deaths=2), CountingUnit("b", tmp_path)]
    bar = Bar()
    found = run_units(units, scheduler, bar)
    assert squares(found["a"]) == expected("a")
    processes = [result["process"] for result in found["a"]]
    assert len(set(processes)) == 2
    assert processes[0] == processes[1]
    assert len(units[0].results.read_text().splitlines()) == 5, "no result twice"
    assert bar.n == bar.total == 10


def test_units_without_a_file_are_done_anew(scheduler: str, tmp_path: Path) -> None:
    for _ in range(2):
        bar = Bar()
        found = run_units([UnkeptUnit("a", tmp_path, dies_at=3, deaths=1)], scheduler, bar)
        assert squares(found["a"]) == expected("a")
        assert bar.n == bar.total == 5


def test_no_answer_no_worker_and_several_threads_are_errors(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(jobs, "CONNECT_S", 0.3)
    units = [CountingUnit("a", tmp_path)]
    with socket.create_server(("127.0.0.1", 0)) as server:  # Accepts, but never answers.
        silent = f"tcp://127.0.0.1:{server.getsockname()[1]}"
        for address in (silent, "nowhere", "http://127.0.0.1:80", "tls://127.0.0.1:80"):
            with pytest.raises(OSError, match=f"'{address}': no scheduler answers there: "):
                run_units(units, address, Bar())
    with LocalCluster(n_workers=0, processes=False, protocol="tcp", **LOOPBACK) as cluster:
        address = cluster.scheduler_address
        with pytest.raises(RuntimeError, match=f"no workers; start some: dask worker {address} "):
            run_units(units, address, Bar())
        cluster.scale(1)
        cluster.worker_spec[0]["options"]["nthreads"] = 2
        wait_for(lambda: cluster.scheduler.workers)
        with pytest.raises(RuntimeError, match="number of threads is 2, but must be 1"):
            run_units(units, address, Bar())
    assert not list(tmp_path.iterdir())


def test_a_worker_with_other_code_is_rejected(tmp_path: Path) -> None:
    root = Path(package.__file__).parents[1]
    for name in ("gslts", "gslts_bench", "gslts_sim"):
        shutil.copytree(root / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    with (tmp_path / "gslts/types.py").open("a") as file:
        file.write("# Another commit.\n")
    with LocalCluster(n_workers=0, processes=False, protocol="tcp", **LOOPBACK) as cluster:
        arguments = ("worker", cluster.scheduler_address, "--nthreads", "1", "--no-dashboard")
        with subprocess.Popen(
            [sys.executable, "-m", "dask", *arguments, "--host", "127.0.0.1"],
            env={**os.environ, "PYTHONPATH": str(tmp_path)},
            stderr=subprocess.DEVNULL,
        ) as process:
            try:
                wait_for(lambda: cluster.scheduler.workers)
                with pytest.raises(RuntimeError, match=r"worker tcp.*: its code is \w+, but must"):
                    run_units([CountingUnit("a", tmp_path)], cluster.scheduler_address, Bar())
            finally:
                process.terminate()
    assert not (tmp_path / "a.jsonl").exists()


def test_a_command_names_what_is_wrong_in_one_line(tmp_path: Path) -> None:
    arguments = ("bench", "detect", "--room", "kitchen", "--seeds", "3:4", "--work", "work")
    for options, message in (
        (("--scheduler", "nowhere"), "gslts: 'nowhere': no scheduler answers there: missing port"),
        (("--scheduler", "tcp://127.0.0.1:1", "--jobs", "2"), "gslts: --jobs is for this machine"),
    ):
        rejected = gslts(*arguments, *options, cwd=tmp_path)
        assert rejected.returncode == 1
        assert rejected.stderr.startswith(message)
        assert rejected.stderr.count("\n") == 1


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
