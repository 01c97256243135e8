"""Runs the command `gslts` as a user does, in a process of its own."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

MAIN = "import sys; from gslts.cli import main; sys.argv[0] = 'gslts'; main()"
STOPPED = """
import importlib, os
module = importlib.import_module({module!r})
function, calls = getattr(module, {name!r}), 0
def counted(*arguments, **named):
    global calls
    result = function(*arguments, **named)
    calls += 1
    if calls == {call}:
        os.kill(os.getpid(), {number})
    return result
setattr(module, {name!r}, counted)
"""
LONG_S = 300.0
"""More than anything here takes: what lasts so long has failed."""


def gslts(
    *arguments: str | Path, cwd: Path, before: str = "", session: bool = False
) -> subprocess.CompletedProcess[str]:
    """Run the command in a folder, without colours and 200 columns wide.

    Args:
        arguments: Of the command.
        cwd: The folder.
        before: Python code that its process runs first, such as `stopped_at` returns.
        session: Return only when its child processes have ended, too.
    """
    with subprocess.Popen(
        [sys.executable, "-c", before + MAIN, *map(str, arguments)],
        cwd=cwd,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={**os.environ, "NO_COLOR": "1", "COLUMNS": "200"},
        start_new_session=session,
    ) as process:
        output, errors = process.communicate()
    if session:
        _wait_for_group(process.pid)
    return subprocess.CompletedProcess(process.args, process.returncode, output, errors)


def stopped_at(function: str, call: int, number: signal.Signals = signal.SIGKILL) -> str:
    """Return code after which a process sends itself a signal.

    Args:
        function: Its module and its name, such as `gslts.keeper.keeper:write_state`.
        call: The signal comes when this function has returned so many times.
        number: Of the signal.
    """
    module, name = function.split(":")
    return STOPPED.format(module=module, name=name, call=call, number=int(number))


def _wait_for_group(group: int) -> None:
    give_up_s = time.monotonic() + LONG_S
    while time.monotonic() < give_up_s:
        try:
            os.killpg(group, 0)
        except ProcessLookupError:
            return
        time.sleep(0.01)
    raise AssertionError("a child process goes on")
