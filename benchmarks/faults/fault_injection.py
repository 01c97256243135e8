"""Fault injection: runs a function in a child process, and kills it or fails its writes."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

MAX_RUN_S = 900
"""Maximum run time, s; a longer run hangs and is ended."""
SOURCE = Path(__file__).with_name("failing_writes.c")
"""Library that lets system calls fail."""
BROKEN_CODE = 70
"""Exit status of a child that did not run the function; no command uses it."""


@dataclass(frozen=True)
class Fault:
    """A call that changes files and fails.

    Attributes:
        at: Number of the call, counted from 1; 0 means none.
        error: Error number such as ENOSPC.
        persistent: All later calls fail as well.
    """

    at: int = 0
    error: int = errno.EIO
    persistent: bool = False


@dataclass(frozen=True)
class Outcome:
    """Result of a run.

    Attributes:
        code: Exit status; None if it was killed.
        stdout: Standard output.
        stderr: Standard error.
        calls: Calls that changed files below the folder, if a fault was given: one line each, with
            its number; a failed one ends with FAILS.
        seconds: Run time, s.
    """

    code: int | None
    stdout: str
    stderr: str
    calls: list[str]
    seconds: float

    @property
    def failures(self) -> int:
        """Number of failed calls."""
        return sum(call.endswith(" FAILS") for call in self.calls)

    @property
    def summary(self) -> str:
        """Exit status and error output in one line."""
        end = "killed" if self.code is None else f"ended with {self.code}"
        return f"{end}, {self.stderr.strip()!r}"


def run_disturbed(
    folder: Path,
    run: Callable[[], None],
    *,
    kill_after_s: float | None = None,
    fault: Fault | None = None,
) -> Outcome:
    """Run a function in a forked child process.

    Modules that the caller imported are not imported again, so that the child is killed during its
    work and not during imports.

    Args:
        folder: Working directory of the child; faults apply to the files below it.
        run: Ends the process as a command does.
        kill_after_s: Time of SIGKILL after the start, s; None means never.
        fault: Fault of the disk; needs the environment of `failing_disk`.

    Returns:
        Exit status, output, calls and run time.
    """
    with tempfile.TemporaryDirectory() as aside:
        out, err, calls = (Path(aside) / name for name in ("out", "err", "calls"))
        start_s = time.monotonic()
        process = os.fork()
        if process == 0:
            _become(folder, run, (out, err), _environment(folder, fault, calls))
        if kill_after_s is not None:
            time.sleep(kill_after_s)
            os.kill(process, signal.SIGKILL)
        _, status = os.waitpid(process, 0)
        seconds = time.monotonic() - start_s
        code = os.waitstatus_to_exitcode(status)
        return Outcome(
            None if code == -signal.SIGKILL else code,
            out.read_text() if out.exists() else "",
            err.read_text() if err.exists() else "",
            calls.read_text().splitlines() if calls.exists() else [],
            seconds,
        )


@contextmanager
def failing_disk() -> Iterator[dict[str, str]]:
    """Compile the library of faults.

    Yields:
        Environment of a process whose disk can fail.

    Raises:
        OSError: There is no C compiler `cc`.
        subprocess.CalledProcessError: The compiler failed.
    """
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / "failing_writes.so"
        subprocess.run(
            ["cc", "-shared", "-fPIC", "-O1", "-o", str(library), str(SOURCE), "-ldl"], check=True
        )
        yield {**os.environ, "LD_PRELOAD": str(library)}


def _environment(folder: Path, fault: Fault | None, calls: Path) -> dict[str, str]:
    if fault is None:
        return {}
    given = {"FAULT_FOLDER": str(folder.resolve()), "FAULT_LOG": str(calls)}
    if fault.at:
        given |= {"FAULT_AT": str(fault.at), "FAULT_ERRNO": str(fault.error)}
    if fault.persistent:
        given["FAULT_LASTS"] = "1"
    return given


def _become(
    folder: Path, run: Callable[[], None], files: tuple[Path, Path], environment: dict[str, str]
) -> None:
    """Run the function as the child process; does not return."""
    code = BROKEN_CODE
    try:
        for descriptor, path in enumerate(files, start=1):
            os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT, 0o644), descriptor)
        signal.alarm(MAX_RUN_S)
        os.chdir(folder)
        os.environ.update(environment)
        run()
        code = 0
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 0 if end.code is None else 1
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
