"""Units of work done by several processes, whose results are kept as they come."""

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
from typing import Any, Protocol, TypeVar, cast

from pydantic import BaseModel

from gslts.io.atomic_files import name_in_errors

Result = dict[str, Any]
"""In values of JSON; `id` tells it from others of the unit, `error` why there is none."""
Record = TypeVar("Record", bound=BaseModel)
RecordOut = TypeVar("RecordOut", bound=BaseModel, covariant=True)
Add = Callable[[Result], None]
Tell = Callable[[float], None]

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Variables by which libraries are told to use one core, as times are those of one."""


class Unit(Protocol):
    """What one process does at a time; goes to it as a copy.

    Attributes:
        name: For messages.
        results: The file of its results, the same as long as they are valid; None if it has none.
    """

    @property
    def name(self) -> str: ...  # noqa: D102

    @property
    def results(self) -> Path | None: ...  # noqa: D102

    def seconds(self, done: frozenset[str]) -> float:
        """About how long it takes where some results are there already."""
        ...

    def run(self, done: frozenset[str], add: Add, tell: Tell) -> None:
        """Finds the results that are not there yet.

        Args:
            done: Their ids.
            add: Is given each as it comes.
            tell: Is told of work done, in the seconds that it usually takes.
        """
        ...


class RecordUnit(Unit, Protocol[RecordOut]):
    """One whose results are records."""

    def record_of(self, result: Result) -> RecordOut | None:
        """What a result was; None if it is not asked for this time.

        Raises:
            ValueError: It is no such record.
        """
        ...


def run_for_records(
    units: Sequence[RecordUnit[RecordOut]], jobs: int, bar: Any
) -> tuple[list[RecordOut], dict[str, str]]:
    """Does what is left of all units, as `run_units`.

    Returns:
        The records that are asked for, in the order of the units; and what failed as a whole, by
        its name, with the reason.

    Raises:
        OSError: Results cannot be kept.
        ValueError: Kept results are none.
    """
    found = run_units(units, jobs, bar)
    records: list[RecordOut] = []
    failed: dict[str, str] = {}
    for unit in units:
        for result in found[unit.name]:
            if result["id"] == unit.name:
                failed[unit.name] = result["error"]
            elif (record := unit.record_of(result)) is not None:
                records.append(record)
    return records, failed


def run_units(units: Sequence[Unit], jobs: int, bar: Any) -> dict[str, list[Result]]:
    """Does what is left of all units, several at a time.

    Args:
        units: Of different names.
        jobs: How many processes.
        bar: As tqdm's; its total is set.

    Returns:
        All results of each unit, by its name, those of earlier runs first; what failed as a whole
        has one with an error alone.

    Raises:
        OSError: Results cannot be kept.
    """
    found = {unit.name: kept_results(unit.results) for unit in units}
    done = {name: frozenset(result["id"] for result in results) for name, results in found.items()}
    bar.reset(total=sum(unit.seconds(done[unit.name]) for unit in units))
    waiting = list(reversed(units))
    busy: dict[Connection, tuple[SpawnProcess, Unit, list[float]]] = {}
    idle: list[tuple[SpawnProcess, Connection]] = []
    try:
        while waiting or busy:
            while waiting and len(busy) < jobs:
                process, pipe = idle.pop() if idle else _start()
                unit = waiting.pop()
                busy[pipe] = process, unit, []
                pipe.send((unit, done[unit.name]))
            for ready in wait(list(busy)):
                pipe = cast(Connection, ready)
                process, unit, told = busy[pipe]
                try:
                    message = pipe.recv()
                except EOFError:
                    process.join()
                    message = f"its process ended with code {process.exitcode}"
                if isinstance(message, float):
                    told.append(message)
                    bar.update(message)
                    continue
                if isinstance(message, dict):
                    if unit.results is not None:
                        _keep(unit.results, message)
                    found[unit.name].append(message)
                    continue
                if message is not None:
                    found[unit.name].append({"id": unit.name, "error": message})
                bar.update(unit.seconds(done[unit.name]) - sum(told))
                del busy[pipe]
                if process.is_alive():
                    idle.append((process, pipe))
    finally:
        for process in [*(one for one, _, _ in busy.values()), *(one for one, _ in idle)]:
            process.kill()  # What it was making is no file yet.
            process.join()
    return found


def kept_results(path: Path | None) -> list[Result]:
    """The results in a file, without those that are errors, which may not come again.

    A last line that a stop cut off is removed.

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


def validated(result: Result, record: type[Record], path: Path) -> Record:
    """A result as the record that it was.

    Args:
        result: From `run_units`.
        record: Its model.
        path: The file of the results of its unit.

    Raises:
        ValueError: It is none.
    """
    try:
        return record.model_validate_json(json.dumps(result))
    except ValueError:
        raise ValueError(f"{path}: {result['id']}: this is no result; remove the file") from None


def _keep(path: Path, result: Result) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    with name_in_errors(path), path.open("ab") as file:
        file.write(json.dumps(result).encode() + b"\n")


def _start() -> tuple[SpawnProcess, Connection]:
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_work, args=(theirs,), daemon=True)
    with _one_thread():
        process.start()
    theirs.close()
    return process, ours


@contextmanager
def _one_thread() -> Iterator[None]:
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
    """What a process does: the units that it is given, until it is given no more."""
    import cv2

    cv2.setNumThreads(1)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # The process that started it decides.
    threading.Thread(target=_die_with_parent, daemon=True).start()
    while True:
        unit, done = pipe.recv()
        try:
            unit.run(done, pipe.send, lambda seconds: pipe.send(float(seconds)))
        except Exception as error:  # One home that fails must not end the others.
            pipe.send(message_of(error))
        else:
            pipe.send(None)


def _die_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


def message_of(error: Exception) -> str:
    """What an error says, in one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())
