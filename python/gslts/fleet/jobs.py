"""Units of work on the cores of this machine or on the workers of a Dask scheduler.

Results are kept in files as they come, by the worker: a unit whose worker is lost, or whose run was
stopped, continues with the results that are missing.
"""

from __future__ import annotations

import asyncio
import fcntl
import json
import logging
import os
import pickle
import signal
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from itertools import islice
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Protocol
from uuid import uuid4

from gslts.fleet.installation import describe_installation
from gslts.io.messages import to_line

if TYPE_CHECKING:
    from distributed import Client, LocalCluster, Worker

Result = dict[str, Any]
"""JSON values; `id` identifies a result within its unit, `error` is the reason if there is none."""
Add = Callable[[Result], None]
"""Receives results as they come."""
Jobs = int | str
"""Number of processes of this machine, `LOCAL`, or the address of a Dask scheduler."""

IGNORE_CTRL_C = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)"
"""Python code that workers of this machine run first, also those that replace lost ones."""
LOCAL = "local"
"""A process for each core of this machine."""
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Environment variables that restrict libraries to one core, as times are those of one."""
LOCAL_CONFIG = {
    "distributed.scheduler.http.routes": [],
    "distributed.worker.http.routes": [],
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "10s",
    "distributed.nanny.pre-spawn-environ": dict.fromkeys(THREADS, "1"),
}
"""Settings of Dask on this machine: no pages, no profiler, rare checks of event loops and memory,
which took 4 % of two cores, and an allocator that keeps memory for the next array, which Dask would
return to the system each time (`MALLOC_TRIM_THRESHOLD_`)."""
CONNECT_S, CLOSE_S = 5.0, 1.0
"""Maximum time for a scheduler's answer, and for a worker of this machine to end by itself."""


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


def run_units(units: Sequence[Unit], jobs: Jobs, bar: Any) -> dict[str, list[Result]]:
    """Do what is left of all units, one at a time in each worker.

    A unit whose worker is lost is done by another one, a few times.

    Args:
        units: Units of different names.
        jobs: Workers.
        bar: Progress bar with tqdm's `reset` and `update`; counts results.

    Returns:
        All results by name of the unit, those of earlier runs first. A unit that failed as a whole
        has a last result with its own name as id and an error.

    Raises:
        ImportError: Dask is not installed.
        OSError: A file of results cannot be read, or no scheduler answers.
        RuntimeError: There is no worker, one has another installation, or the scheduler was lost.
        ValueError: A file of results is damaged.
    """
    left = {unit.name: max(0, unit.count - len(read_results(unit.results))) for unit in units}
    bar.reset(total=sum(left.values()))
    topic, waiting = f"gslts-{uuid4()}", iter(units)
    with _connect(jobs) as client:
        from distributed import CancelledError, KilledWorker, as_completed

        client.subscribe_topic(topic, partial(_count, left, bar))
        expected = _expected_workers()
        found: dict[str, list[Result]] = {}
        running, units_of = as_completed(), {}

        def start(number: int) -> None:
            for unit in islice(waiting, number):
                job = (pickle.dumps(unit), expected, topic)
                # A lambda is sent as code: the scheduler unpickles it, and need not have gslts.
                future = client.submit(
                    lambda *job: import_module("gslts.fleet.jobs")._work(*job), *job, pure=False
                )
                units_of[future.key] = unit
                running.add(future)

        # No more than there are workers: who waits behind a unit that ends its worker is blamed.
        start(len(client.nthreads()))
        for future in running:
            unit = units_of.pop(future.key)
            try:
                found[unit.name] = future.result()
            except CancelledError:
                raise RuntimeError(f"{jobs}: the scheduler was lost; run again to go on") from None
            except KilledWorker as error:
                attempts = error.allowed_failures + 1
                reason = f"its worker process ended in each of {attempts} attempts"
                found[unit.name] = [*read_results(unit.results), _failure(unit, reason)]
            except Exception as error:
                found[unit.name] = [_failure(unit, message_of(error))]
            bar.update(left[unit.name])  # There may be fewer results than were expected.
            start(1)
    return found


def read_results(path: Path | None) -> list[Result]:
    """Read the results in a file, without errors, which are tried again.

    A last line that a stop cut off is left out.

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
    results = {}
    for number, line in enumerate(path.read_bytes().splitlines(keepends=True), start=1):
        if not line.endswith(b"\n"):
            break
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
    return to_line(f"{type(error).__name__}: {error}")


def _count(left: dict[str, int], bar: Any, event: tuple[float, str]) -> None:
    """Count a new result of the unit that an event names."""
    left[event[1]] -= 1
    bar.update(1)


def _failure(unit: Unit, reason: str) -> Result:
    return {"id": unit.name, "error": reason}


@contextmanager
def _connect(jobs: Jobs) -> Iterator[Client]:
    """Connect to workers that run what runs here."""
    try:
        from distributed import Client
    except ImportError as error:
        raise ImportError("jobs need Dask: pip install 'gslts[fleet]'") from error
    logging.getLogger("distributed.client").setLevel(logging.CRITICAL)  # It raises errors.
    if isinstance(jobs, int) or jobs == LOCAL:
        with _local_cluster(None if jobs == LOCAL else int(jobs)) as cluster:
            yield cluster.get_client()
        return
    try:
        asyncio.run(asyncio.wait_for(_try_connection(jobs), CONNECT_S))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Versions are compared below.
            client = Client(jobs, timeout=CONNECT_S)
    except (OSError, TypeError, ValueError) as error:
        reason = str(error) or f"nothing came in {CONNECT_S:g} s"
        raise OSError(f"{jobs!r}: no scheduler answers there: {reason}") from error
    with client:
        if not client.nthreads():
            raise RuntimeError(f"{jobs}: no workers; start some: dask worker {jobs} --nthreads 1")
        for worker, answer in client.run(
            _difference, _expected_workers(), on_error="return"
        ).items():
            if answer is not None:
                raise RuntimeError(f"{jobs}: worker {worker}: {answer}")
        yield client


async def _try_connection(address: str) -> None:
    """Connect once: a client would wait for ever for a server that says nothing."""
    from distributed import Security
    from distributed.comm import connect

    comm = await connect(address, CONNECT_S, **Security().get_connection_args("client"))
    await comm.close()


@contextmanager
def _local_cluster(processes: int | None) -> Iterator[LocalCluster]:
    """Start so many workers on this machine, or one for each core; end them at once."""
    import dask
    from distributed import LocalCluster

    os.environ.update(dict.fromkeys(THREADS, "1"))  # Dask passes them on to its workers.
    with _without_ctrl_c(), dask.config.set(LOCAL_CONFIG):
        cluster = LocalCluster(
            n_workers=processes,
            threads_per_worker=1,
            memory_limit=None,
            preload=IGNORE_CTRL_C,
            host="127.0.0.1",
            dashboard_address="127.0.0.1:0",  # None would be port 8787, which may be in use.
            scheduler_kwargs={"dashboard": False},
            security=True,  # With keys of its own: other users of this machine cannot connect.
            silence_logs=logging.CRITICAL,
        )
    try:
        yield cluster
    finally:
        with _without_ctrl_c(), cluster:
            closing = [nanny.close(timeout=CLOSE_S) for nanny in cluster.workers.values()]
            cluster.sync(asyncio.gather, *closing)


@contextmanager
def _without_ctrl_c() -> Iterator[None]:
    """Ignore Ctrl-C, here and in processes that are started."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _expected_workers() -> dict[str, Any]:
    """Return what workers must have: the installation, single threads, and the current folder."""
    single = {**dict.fromkeys(THREADS, "1"), "number of threads": 1}
    return {**describe_installation(), **single, "folder": str(Path.cwd())}


def _difference(expected: dict[str, Any], dask_worker: Worker | None = None) -> str | None:
    """Return in what the worker that runs this differs from what is expected."""
    from distributed import get_worker

    own = {
        **describe_installation(),
        **{name: os.environ.get(name) for name in THREADS},
        "number of threads": (dask_worker or get_worker()).state.nthreads,
        "folder": expected["folder"] if Path(expected["folder"]).is_dir() else None,
    }
    for name in {**expected, **own}:
        theirs, ours = own.get(name), expected.get(name)
        if theirs != ours:
            return f"its {name} is {theirs}, but must be {ours}"
    return None


def _work(pickled: bytes, expected: dict[str, Any], topic: str) -> list[Result]:
    """Run in a worker: do what is left of a unit, and return all its results."""
    import cv2
    from distributed import get_worker

    if (difference := _difference(expected)) is not None:  # It may have come after the others.
        raise RuntimeError(f"worker {get_worker().address}: {difference}")
    os.chdir(expected["folder"])
    cv2.setNumThreads(1)
    unit: Unit = pickle.loads(pickled)
    with _open_results(unit.results) as file:
        results = read_results(unit.results)

        def add(result: Result) -> None:
            file.write(json.dumps(result).encode() + b"\n")
            file.flush()
            results.append(result)
            get_worker().log_event(topic, unit.name)

        try:
            unit.run(frozenset(result["id"] for result in results), add)
        except Exception as error:  # A home that fails must not end the others.
            results.append(_failure(unit, message_of(error)))
    return results


@contextmanager
def _open_results(path: Path | None) -> Iterator[IO[bytes]]:
    """Open a file of results for this process alone, without a last line that was cut off."""
    if path is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
    with Path(path or os.devnull).open("ab") as file:
        if path is not None:
            fcntl.flock(file, fcntl.LOCK_EX)  # A worker that was given up may still run.
            file.truncate(path.read_bytes().rfind(b"\n") + 1)
        yield file
