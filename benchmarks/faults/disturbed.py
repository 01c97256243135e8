"""Runs something in a process of its own, and kills it or lets its disk fail meanwhile."""

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

LONGEST_S = 900
"""What takes longer hangs, and is ended."""
SOURCE = Path(__file__).with_name("failing_writes.c")


@dataclass(frozen=True)
class Fault:
    """A call that fails, of those that change files.

    Attributes:
        at: Which one, from 1 on; 0 means that none does.
        error: Such as ENOSPC.
        lasts: Whether all after it fail as well.
    """

    at: int = 0
    error: int = errno.EIO
    lasts: bool = False


@dataclass(frozen=True)
class Outcome:
    """What became of a run.

    Attributes:
        code: It ended with; None if it was killed.
        out: What it printed.
        err: What it printed as errors.
        calls: That changed files below the folder, if the disk was watched; one in a line, with its
            number, and FAILS behind those that failed.
        seconds: It took.
    """

    code: int | None
    out: str
    err: str
    calls: list[str]
    seconds: float

    @property
    def failures(self) -> int:
        """How many calls failed."""
        return sum(call.endswith(" FAILS") for call in self.calls)

    @property
    def told(self) -> str:
        """How it ended, in a few words."""
        end = "killed" if self.code is None else f"ended with {self.code}"
        return f"{end}, {self.err.strip()!r}"


def disturbed(
    folder: Path,
    run: Callable[[], None],
    *,
    kill_after_s: float | None = None,
    fault: Fault | None = None,
) -> Outcome:
    """Runs something, in that folder.

    It is forked: what the caller has imported need not be imported again, and a process that is
    killed is killed amid its work.

    Args:
        folder: Whose files are watched.
        run: Ends the process as a command does.
        kill_after_s: When it gets SIGKILL, s after its start.
        fault: Of the disk below the folder; needs `failing_disk`.
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
    """The environment of a process whose disk can fail.

    Raises:
        OSError: There is no compiler of C, `cc`.
        subprocess.CalledProcessError: It failed.
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
    if fault.lasts:
        given["FAULT_LASTS"] = "1"
    return given


def _become(
    folder: Path, run: Callable[[], None], files: tuple[Path, Path], environment: dict[str, str]
) -> None:
    """What the child does; does not return."""
    code = 70  # Something that no command ends with.
    try:
        for descriptor, path in enumerate(files, start=1):
            os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT, 0o644), descriptor)
        signal.alarm(LONGEST_S)
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
