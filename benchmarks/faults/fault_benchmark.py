"""Whether maps outlast processes that are killed, and disks that fail, at any moment.

    python benchmarks/faults/fault_benchmark.py kill --moments 500
    python benchmarks/faults/fault_benchmark.py writes

What is disturbed: `commits` adds versions to a map, `import` and `map` are the commands that make
one, `run` is the command that keeps it up to date. `kill` kills them at random moments of their
run. `writes` lets each call that changes a file fail in turn, that one or all from there on, as if
the disk were full, broken or read-only. Each time, the map must open, verify, and hold each version
whose commit had returned, bit by bit, or not be there at all; and a command that fails must say so
in one line. Another command that adds versions is disturbed with

    python benchmarks/faults/fault_benchmark.py kill --map MAP --told REGEX -- COMMAND {map} ...

where {map} becomes a copy of the map, and the expression finds the numbers of versions in what the
command prints after their commits.
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

from disturbed import Fault, Outcome, disturbed, failing_disk
from subjects import MAP, Command, Commits, NewMap, Rounds, Subject, write_home, write_inputs
from tqdm import tqdm

ERRORS = (errno.ENOSPC, errno.EIO, errno.EROFS)
NAMES = ("commits", "import", "map", "run")
FAST = ("--preset", "fast", "--iterations", "33", "--set", "variant_steps=0", "--threads", "1")
SHOWN, WIDTH = 20, 1000


class Tally:
    """Counts runs of a subject and what was wrong after them."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.runs = self.ended = self.failed = 0
        self.problems: list[str] = []

    def add(self, when: str, outcome: Outcome, problems: list[str]) -> None:
        """Counts one."""
        self.runs += 1
        self.ended += outcome.code == 0
        self.failed += outcome.code not in (0, None)
        self.problems += [f"{self.name}, {when}: {one}" for one in problems]


def kill(subject: Subject, folder: Path, arguments: argparse.Namespace) -> Tally:
    """Kills it at moments that are uniform over the time of a run that nobody disturbs."""
    rng, tally = random.Random(arguments.seed), Tally(subject.name)
    subject.prepare(folder, fresh=True)
    whole = disturbed(folder, subject.run)
    tally.add("not disturbed", whole, subject.problems(folder, whole))
    if whole.code != 0:
        tally.problems.append(f"{subject.name} cannot be run: {whole.told}")
        return tally
    fresh, killed = True, 0
    with tqdm(total=arguments.moments, desc=f"kill {subject.name}", file=terminal()) as bar:
        while killed < arguments.moments:
            subject.prepare(folder, fresh=fresh)
            moment_s = rng.uniform(0, whole.seconds)
            outcome = disturbed(folder, subject.run, kill_after_s=moment_s)
            problems = subject.problems(folder, outcome)
            if outcome.code not in (0, None):  # What a killed run left must not stop the next one.
                problems.append(f"it ended with {outcome.code}: {outcome.told}")
            tally.add(f"killed after {moment_s:.4f} s", outcome, problems)
            fresh = outcome.code is not None  # It was done before: what a killed run left is gone.
            killed += not fresh
            bar.update(not fresh)
            bar.set_postfix(problems=len(tally.problems), refresh=False)
    return tally


def writes(subject: Subject, folder: Path, arguments: argparse.Namespace) -> Tally:
    """Lets each call that changes a file fail in turn."""
    tally = Tally(subject.name)
    subject.prepare(folder, fresh=True)
    whole = disturbed(folder, subject.run, fault=Fault())
    tally.add("not disturbed", whole, subject.problems(folder, whole))
    if whole.code != 0 or not whole.calls:
        tally.problems.append(f"{subject.name} cannot be run: {whole.told}")
        return tally
    faults = [Fault(*one) for one in product(range(1, len(whole.calls) + 1), ERRORS, (False, True))]
    if arguments.runs is not None:
        faults = random.Random(arguments.seed).sample(faults, min(arguments.runs, len(faults)))
    for fault in tqdm(faults, desc=f"writes of {subject.name}", file=terminal()):
        subject.prepare(folder, fresh=True)
        outcome = disturbed(folder, subject.run, fault=fault)
        name = errno.errorcode[fault.error]
        when = f"{name} {'from' if fault.lasts else 'at'} call {fault.at}"
        if len(outcome.calls) >= fault.at:
            when += f", {outcome.calls[fault.at - 1]}"
        tally.add(
            when, outcome, [*wrong_words(outcome, folder), *subject.problems(folder, outcome)]
        )
    return tally


def terminal() -> TextIO:
    """The error output of this process: its bars are not drawn into that of a child with bars."""
    return os.fdopen(os.dup(sys.stderr.fileno()), "w", encoding="utf-8")


def wrong_words(outcome: Outcome, folder: Path) -> list[str]:
    """Whether it failed in one line which names what could not be written, or not at all."""
    lines = outcome.err.splitlines()
    if outcome.code == 0:
        return [f"it printed {outcome.err!r}"] if lines else []
    if outcome.code != 1 or len(lines) != 1 or not lines[0].startswith("gslts: "):
        return [f"it {outcome.told}"]
    named = MAP in lines[0] or str(folder.resolve()) in lines[0]
    return [] if named else [f"it names no file: {lines[0]}"]


def subjects_of(arguments: argparse.Namespace, inputs: Path) -> Iterator[Subject]:
    """Those that are wanted."""
    if arguments.command:
        yield Command(arguments.map.resolve(), arguments.command, arguments.told)
        return
    visit, ply = inputs / "visit", inputs / "made_up.ply"
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
    for problem in tally.problems[:SHOWN]:
        print(problem[:WIDTH], file=sys.stderr)
    if len(tally.problems) > SHOWN:
        print(f"... and {len(tally.problems) - SHOWN} problems more", file=sys.stderr)
    killed = tally.runs - tally.ended - tally.failed
    counts = (tally.runs, killed, tally.failed, tally.ended, len(tally.problems))
    print(f"| {tally.name} | {' | '.join(map(str, counts))} |", flush=True)


def arguments_of() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("way", choices=("kill", "writes"))
    parser.add_argument("--subjects", nargs="+", choices=NAMES, default=NAMES)
    parser.add_argument("--moments", type=int, default=500, help="of kill, for each subject")
    parser.add_argument("--runs", type=int, help="of writes, by chance; all if not given")
    parser.add_argument("--more", type=int, default=8, help="versions that a run of commits adds")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--map", type=Path, help="of the command")
    parser.add_argument("--told", default=r"is version (\d+) now")
    given = sys.argv[1:]
    end = given.index("--") if "--" in given else len(given)
    arguments = parser.parse_args(given[:end], argparse.Namespace(command=given[end + 1 :]))
    if arguments.command and arguments.map is None:
        parser.error("a command needs --map")
    return arguments


def main() -> None:
    arguments = arguments_of()
    if arguments.way == "writes" and "LD_PRELOAD" not in os.environ:
        with failing_disk() as environment:
            sys.exit(subprocess.run([sys.executable, *sys.argv], env=environment).returncode)
    # A child would share its lock, and not give it back when it is killed; nor may its thread hold
    # one while a child is forked.
    tqdm.set_lock(threading.RLock())
    tqdm.monitor_interval = 0
    disturb = kill if arguments.way == "kill" else writes
    whole = True
    print("| disturbed | runs | killed | failed | ended well | problems |")
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
