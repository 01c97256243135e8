"""Durability of maps under killed processes and failing disks.

    python benchmarks/faults/fault_benchmark.py kill --moments 500
    python benchmarks/faults/fault_benchmark.py writes

Subjects: `commits` adds versions to a map, `import` and `map` are the commands that make one, `run`
is the command that keeps it up to date. `kill` kills them at random times. `writes` lets each call
that changes a file fail in turn, alone or with all later calls, as if the disk were full, broken or
read-only. After each run, the map must open, verify, and hold each version whose commit had
returned, bit by bit, or not exist at all; a command that fails must say so in one line. Another
command that adds versions is tested with

    python benchmarks/faults/fault_benchmark.py kill --map MAP --reported REGEX -- COMMAND {map} ...

where {map} becomes a copy of the map, and the expression finds the version numbers that the command
prints after its commits.
"""

from __future__ import annotations

import argparse
import errno
import os
import random
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import TextIO

from fault_injection import Fault, Outcome, failing_disk, run_disturbed
from subjects import MAP, Command, Commits, NewMap, Rounds, Subject, write_home, write_inputs
from tqdm import tqdm

ERRORS = (errno.ENOSPC, errno.EIO, errno.EROFS)
"""Errors of a full, a broken and a read-only disk."""
NAMES = ("commits", "import", "map", "run")
"""Subjects."""
FAST = ("--preset", "fast", "--iterations", "33", "--set", "variant_steps=0", "--threads", "1")
"""Options of a mapping run of a few seconds."""
MAX_SHOWN, MAX_WIDTH = 20, 1000
"""Maximum number of problems that are printed, and of characters of each."""


class Tally:
    """Number of runs of a subject, and the problems after them."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.runs = self.ended = self.failed = 0
        self.problems: list[str] = []

    def add(self, when: str, outcome: Outcome, problems: list[str]) -> None:
        """Count a run.

        Args:
            when: Description of the fault.
            outcome: Of the run.
            problems: One line each.
        """
        self.runs += 1
        self.ended += outcome.code == 0
        self.failed += outcome.code not in (0, None)
        self.problems += [f"{self.name}, {when}: {problem}" for problem in problems]


def kill(subject: Subject, folder: Path, arguments: argparse.Namespace) -> Tally:
    """Kill a subject at times that are uniform over the duration of an undisturbed run."""
    rng, tally = random.Random(arguments.seed), Tally(subject.name)
    subject.prepare(folder, fresh=True)
    whole = run_disturbed(folder, subject.run)
    tally.add("not disturbed", whole, subject.problems(folder, whole))
    if whole.code != 0:
        tally.problems.append(f"{subject.name} cannot be run: {whole.summary}")
        return tally
    fresh, killed = True, 0
    with tqdm(total=arguments.moments, desc=f"kill {subject.name}", file=terminal()) as bar:
        while killed < arguments.moments:
            subject.prepare(folder, fresh=fresh)
            moment_s = rng.uniform(0, whole.seconds)
            outcome = run_disturbed(folder, subject.run, kill_after_s=moment_s)
            problems = subject.problems(folder, outcome)
            if outcome.code not in (0, None):  # Remains of a killed run must not stop the next one.
                problems.append(f"it ended with {outcome.code}: {outcome.summary}")
            tally.add(f"killed after {moment_s:.4f} s", outcome, problems)
            fresh = (
                outcome.code is not None
            )  # It ended before: the remains of killed runs are gone.
            killed += not fresh
            bar.update(not fresh)
            bar.set_postfix(problems=len(tally.problems), refresh=False)
    return tally


def writes(subject: Subject, folder: Path, arguments: argparse.Namespace) -> Tally:
    """Let each call that changes a file fail in turn."""
    tally = Tally(subject.name)
    subject.prepare(folder, fresh=True)
    whole = run_disturbed(folder, subject.run, fault=Fault())
    tally.add("not disturbed", whole, subject.problems(folder, whole))
    if whole.code != 0 or not whole.calls:
        tally.problems.append(f"{subject.name} cannot be run: {whole.summary}")
        return tally
    faults = [
        Fault(*parameters)
        for parameters in product(range(1, len(whole.calls) + 1), ERRORS, (False, True))
    ]
    if arguments.runs is not None:
        faults = random.Random(arguments.seed).sample(faults, min(arguments.runs, len(faults)))
    for fault in tqdm(faults, desc=f"writes of {subject.name}", file=terminal()):
        subject.prepare(folder, fresh=True)
        outcome = run_disturbed(folder, subject.run, fault=fault)
        name = errno.errorcode[fault.error]
        when = f"{name} {'from' if fault.persistent else 'at'} call {fault.at}"
        if len(outcome.calls) >= fault.at:
            when += f", {outcome.calls[fault.at - 1]}"
        tally.add(
            when, outcome, [*wrong_message(outcome, folder), *subject.problems(folder, outcome)]
        )
    return tally


def terminal() -> TextIO:
    """Return a copy of the error output: progress bars of a child do not mix with those here."""
    return os.fdopen(os.dup(sys.stderr.fileno()), "w", encoding="utf-8")


def wrong_message(outcome: Outcome, folder: Path) -> list[str]:
    """Check that a failed command printed one line that names the file, and others none."""
    lines = outcome.stderr.splitlines()
    if outcome.code == 0:
        return [f"it printed {outcome.stderr!r}"] if lines else []
    if outcome.code != 1 or len(lines) != 1 or not lines[0].startswith("gslts: "):
        return [f"it {outcome.summary}"]
    named = MAP in lines[0] or str(folder.resolve()) in lines[0]
    return [] if named else [f"it names no file: {lines[0]}"]


def subjects_of(arguments: argparse.Namespace, inputs: Path) -> Iterator[Subject]:
    """Yield the requested subjects."""
    if arguments.command:
        yield Command(arguments.map.resolve(), arguments.command, arguments.reported)
        return
    visit, ply = inputs / "visit", inputs / "synthetic.ply"
    if {"import", "map"} & {*arguments.subjects}:
        write_inputs(visit, ply)
    if "run" in arguments.subjects:
        write_home(inputs)
    for name in arguments.subjects:
        if name == "commits":
            yield Commits(arguments.more)
        elif name == "import":
            yield NewMap("import", ["import", str(ply)])
        elif name == "run":
            yield Rounds(inputs)
        else:
            yield NewMap("map", ["map", str(visit), *FAST])


def show(tally: Tally) -> None:
    for problem in tally.problems[:MAX_SHOWN]:
        print(problem[:MAX_WIDTH], file=sys.stderr)
    if len(tally.problems) > MAX_SHOWN:
        print(f"... and {len(tally.problems) - MAX_SHOWN} more problems", file=sys.stderr)
    killed = tally.runs - tally.ended - tally.failed
    counts = (tally.runs, killed, tally.failed, tally.ended, len(tally.problems))
    print(f"| {tally.name} | {' | '.join(map(str, counts))} |", flush=True)


def arguments_of() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("fault", choices=("kill", "writes"))
    parser.add_argument("--subjects", nargs="+", choices=NAMES, default=NAMES)
    parser.add_argument("--moments", type=int, default=500, help="kills of each subject")
    parser.add_argument("--runs", type=int, help="random faults of writes; default: all")
    parser.add_argument("--more", type=int, default=8, help="versions per run of commits")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--map", type=Path, help="map of the command")
    parser.add_argument("--reported", default=r"is version (\d+) now")
    given = sys.argv[1:]
    end = given.index("--") if "--" in given else len(given)
    arguments = parser.parse_args(given[:end], argparse.Namespace(command=given[end + 1 :]))
    if arguments.command and arguments.map is None:
        parser.error("a command needs --map")
    return arguments


def main() -> None:
    arguments = arguments_of()
    if arguments.fault == "writes" and "LD_PRELOAD" not in os.environ:
        with failing_disk() as environment:
            sys.exit(subprocess.run([sys.executable, *sys.argv], env=environment).returncode)
    # A killed child would keep a shared lock of tqdm, and its monitor thread may hold one during a
    # fork.
    tqdm.set_lock(threading.RLock())
    tqdm.monitor_interval = 0
    disturb = kill if arguments.fault == "kill" else writes
    whole = True
    print("| subject | runs | killed | failed | ended well | problems |")
    print("| --- | ---: | ---: | ---: | ---: | ---: |", flush=True)
    with tempfile.TemporaryDirectory() as place:
        folder, inputs = Path(place, "work"), Path(place, "inputs")
        folder.mkdir()
        inputs.mkdir()
        for subject in subjects_of(arguments, inputs):
            tally = disturb(subject, folder, arguments)
            show(tally)
            whole = whole and not tally.problems
    sys.exit(not whole)


if __name__ == "__main__":
    main()
