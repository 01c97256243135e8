"""Worker processes for units of work, whose results are kept in files as they come."""

from __future__ import annotations

import json
import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from pathlib import Path
from typing import Any, Protocol, cast

from gslts.io.atomic_files import name_in_errors

Result = dict[str, Any]
"""JSON values; `id` identifies a result within its unit, `error` is the reason if there is none."""
Add = Callable[[Result], None]
"""Receives results as they come."""

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Environment variables that restrict libraries to one core, as times are those of one."""


class Unit(Protocol):
    """Work that one process does at a time; the process receives a copy.

    Attributes:
        name: Name, unique within a run.
        results: File of its results, the same as long as they are valid; None keeps none.
        count: Number of results when all is done, for the progress.
    """

    @property
    def name(self) -> str: ...  # noqa: D102

    @property
    def results(self) -> Path | None: ...  # noqa: D102

    @property
    def count(self) -> int: ...  # noqa: D102

    def run(self, done: frozenset[str], add: Add) -> None:
        """Compute the results that are missing.

        Args:
            done: Ids of the results of earlier runs.
            add: Receives each new result.
        """
        ...


def run_units(units: Sequence[Unit], jobs: int, bar: Any) -> dict[str, list[Result]]:
    """Do what is left of all units in several processes.

    Args:
        units: Units of different names.
        jobs: Number of processes.
        bar: Progress bar with tqdm's `reset` and `update`; counts results.

    Returns:
        All results by name of the unit, those of earlier runs first. A unit that failed as a whole
        has a last result with its own name as id and an error.

    Raises:
        OSError: A file of results cannot be read or written.
        ValueError: A file of results is damaged.
    """
    found = {unit.name: read_results(unit.results) for unit in units}
    done = {name: frozenset(result["id"] for result in results) for name, results in found.items()}
    left = {unit.name: max(0, unit.count - len(done[unit.name])) for unit in units}
    bar.reset(total=sum(left.values()))
    waiting = list(reversed(units))
    busy: dict[Connection, tuple[SpawnProcess, Unit]] = {}
    idle: list[tuple[SpawnProcess, Connection]] = []
    try:
        while waiting or busy:
            while waiting and len(busy) < jobs:
                process, pipe = idle.pop() if idle else _start()
                unit = waiting.pop()
                busy[pipe] = process, unit
                pipe.send((unit, done[unit.name]))
            for ready in wait(list(busy)):
                pipe = cast(Connection, ready)
                process, unit = busy[pipe]
                try:
                    message = pipe.recv()
                except EOFError:
                    process.join()
                    message = f"its process ended with code {process.exitcode}"
                if isinstance(message, dict):
                    _keep(unit.results, message)
                    found[unit.name].append(message)
                    left[unit.name] -= 1
                    bar.update(1)
                    continue
                if message is not None:
                    found[unit.name].append({"id": unit.name, "error": message})
                bar.update(left[unit.name])  # There may be fewer results than were expected.
                del busy[pipe]
                if process.is_alive():
                    idle.append((process, pipe))
    finally:
        for process in [*(entry[0] for entry in busy.values()), *(entry[0] for entry in idle)]:
            process.kill()  # Unfinished work is in no file yet.
            process.join()
    return found


def read_results(path: Path | None) -> list[Result]:
    """Read the results in a file, without errors, which are tried again.

    A last line that a stop cut off is removed from the file.

    Args:
        path: JSON lines; None or a missing file means no results.

    Returns:
        The results by first appearance, the last one of each id.

    Raises:
        OSError: The file cannot be read.
        ValueError: A line is no result.
    """
    if path is None or not path.exists():
        return []
    content = path.read_bytes()
    whole = content[: content.rfind(b"\n") + 1]
    if len(whole) < len(content):
        os.truncate(path, len(whole))
    results = {}
    for number, line in enumerate(whole.splitlines(), start=1):
        try:
            result = json.loads(line)
        except ValueError:
            result = None
        if not isinstance(result, dict) or not isinstance(result.get("id"), str):
            raise ValueError(f"{path}: line {number} is no result; remove the file")
        if result.get("error") is None:
            results[result["id"]] = result
    return list(results.values())


def message_of(error: Exception) -> str:
    """Format an error in one line, with its type.

    Args:
        error: The error.
    """
    return " ".join(f"{type(error).__name__}: {error}".split())


def _keep(path: Path | None, result: Result) -> None:
    """Append a result to a file."""
    if path is None:
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    with name_in_errors(path), path.open("ab") as file:
        file.write(json.dumps(result).encode() + b"\n")


def _start() -> tuple[SpawnProcess, Connection]:
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_work, args=(theirs,), daemon=True)
    with _single_threaded():
        process.start()
    theirs.close()
    return process, ours


@contextmanager
def _single_threaded() -> Iterator[None]:
    """Set `THREADS` to 1 for the processes that are started meanwhile."""
    before = {name: os.environ.get(name) for name in THREADS}
    os.environ.update(dict.fromkeys(THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _work(pipe: Connection) -> None:
    """Run in a worker: do the units that arrive until the process is ended."""
    import cv2

    cv2.setNumThreads(1)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # The parent handles it.
    threading.Thread(target=_end_with_parent, daemon=True).start()
    while True:
        unit, done = pipe.recv()
        try:
            unit.run(done, pipe.send)
        except Exception as error:  # A home that fails must not end the others.
            pipe.send(message_of(error))
        else:
            pipe.send(None)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
