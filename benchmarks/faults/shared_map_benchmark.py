"""Four robots write one shared map while they are killed and their requests fail.

    python benchmarks/faults/shared_map_benchmark.py --moments 500
    python benchmarks/faults/shared_map_benchmark.py --moments 500 --store moto
    python benchmarks/faults/shared_map_benchmark.py --moments 500 --store folder

The first two commands need Azurite or moto, emulators of Azure Blob Storage and of S3
(`object_store.py`), behind `misbehaving_proxy.py`; the last one shares the map through a folder.
Each robot commits updates of its room, and sometimes of one that all change, and pushes; it is
killed at random times and goes on in its clone. At the end all exchange without faults. Then

- the versions of the shared map are 1, 2, 3, ..., and all of their files are intact,
- no update is in it twice,
- each update whose push had returned is there, under the number that it had then,
- each update whose commit had returned is there, or else is recorded as given up in its clone,
- all clones, and a new one, are equal bit by bit, in each version.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import random
import re
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from fault_injection import run_disturbed
from object_store import AZURITE, PROGRAMS, object_store
from shared_writer import given_up_rounds, own_rounds, work
from subjects import check_map
from synthetic_rooms import write_rooms

from gslts.fleet.exchange import clone_map, pull_map, push_map
from gslts.store.causes import UpdateCause
from gslts.store.map_folder import open_map
from gslts.store.robot_name import VARIABLE

ROBOTS = 4
"""Number of writers."""
UPDATES = 8
"""Number of updates of a run that is not killed."""
MAX_RUN_S = 1.0
"""Maximum time after which a robot is killed, s: about the time of a run without faults."""
EXPECTED = re.compile("the store cannot be reached|503 Service Unavailable|push again")
"""Errors of pushes that give up, as the proxy fails too often in a row."""
MAX_SHOWN = 20
"""Maximum number of problems that are printed."""


class Robot:
    """A clone, and what its robot may count on.

    Args:
        folder: Of the clone.
        number: Of the robot, and of its room.
    """

    def __init__(self, folder: Path, number: int) -> None:
        self.folder, self.number, self.name = folder, number, f"robot{number}"
        self.runs = self.killed = self.failed = 0
        self.committed: set[int] = set()
        self.pushed: dict[int, int] = {}
        self.problems: list[str] = []

    def run(self, url: str, kill_after_s: float) -> None:
        """Work in a child process until it ends or is killed.

        Args:
            url: Of the map.
            kill_after_s: Time of SIGKILL, s.
        """
        done = run_disturbed(
            self.folder.parent,
            lambda: work(self.folder, url, self.number, UPDATES),
            kill_after_s=kill_after_s,
        )
        self.runs += 1
        self.killed += done.code is None
        if done.code not in (0, None):
            self.problems.append(f"{self.name} {done.summary}")
        for line in done.stdout.splitlines():
            event, content = json.loads(line)
            if event == "failed":
                self.failed += 1
                if not EXPECTED.search(content):
                    self.problems.append(f"{self.name} cannot push: {content}")
                continue
            self.committed |= set(content.values())
            if event == "pushed":
                self._count_pushed({int(number): done for number, done in content.items()})

    def _count_pushed(self, rounds: dict[int, int]) -> None:
        for number, done in rounds.items():
            if self.pushed.setdefault(number, done) != done:
                self.problems.append(f"{self.name}: version {number} was exchanged")


def disturb(folder: Path, url: str, moments: int, seed: int) -> list[Robot]:
    """Let all robots work at once, each in processes of its own, until each was killed often.

    Args:
        folder: With the clones.
        url: Of the map, with faults.
        moments: Number of kills of all robots.
        seed: Of the moments.
    """
    context = multiprocessing.get_context("fork")  # Children do not import the package again.
    answers: multiprocessing.Queue[Robot] = context.Queue()

    def keep_running(number: int) -> None:
        robot, rng = Robot(folder / f"robot{number}", number), random.Random(seed + number)
        while robot.killed < moments // ROBOTS:
            robot.run(url, rng.uniform(0, MAX_RUN_S))
        answers.put(robot)

    processes = [context.Process(target=keep_running, args=(number,)) for number in range(ROBOTS)]
    for process in processes:
        process.start()
    robots = [answers.get() for _ in processes]
    for process in processes:
        process.join()
    return robots


def find_problems(folder: Path, url: str, robots: list[Robot]) -> list[str]:
    """Exchange all versions, without faults, and check what is left.

    Args:
        folder: With the clones.
        url: Of the map, without faults.
        robots: With what they may count on.

    Returns:
        One line per problem.
    """
    try:
        for robot in robots:
            os.environ[VARIABLE] = robot.name
            push_map(robot.folder, url)
        for robot in robots:
            pull_map(robot.folder, url)
        clone_map(url, folder / "new")
    except (OSError, ValueError) as error:
        return [*(problem for robot in robots for problem in robot.problems), str(error)]
    digests: dict[int, str] = {}
    problems = check_map(folder / "new", [], lambda _: None, digests.__setitem__)
    with open_map(folder / "new") as store:
        found = {
            version.number: (version.robot, version.cause.round)
            for version in store.versions()
            if isinstance(version.cause, UpdateCause)
        }
    counts = Counter(found.values())
    problems += [
        f"{update} is there {count} times" for update, count in counts.items() if count > 1
    ]
    for robot in robots:
        problems += robot.problems
        problems += check_map(robot.folder, digests, digests.get)
        for number, pushed in robot.pushed.items():
            if found.get(number) != (robot.name, pushed):
                problems.append(f"{robot.name}: round {pushed}, version {number}, is lost")
        os.environ[VARIABLE] = robot.name
        shown, given_up = set(own_rounds(robot.folder).values()), given_up_rounds(robot.folder)
        wrong = (robot.committed - shown - given_up) | (shown & given_up)
        problems += [f"{robot.name}: round {number} is lost, or both" for number in sorted(wrong)]
    return problems


@contextmanager
def shared_map(store: str, folder: Path, rate: float, seed: int) -> Iterator[tuple[str, str, str]]:
    """Provide a bucket or a folder for a shared map.

    Args:
        store: Name of `PROGRAMS`, or "folder".
        folder: For the map of the store "folder".
        rate: Share of the requests with a fault.
        seed: Of the faults.

    Yields:
        URL, and the endpoints with and without faults; these are empty for a folder.
    """
    if store == "folder":
        yield f"file://{folder}", "", ""
        return
    program = PROGRAMS[store]
    with object_store(program) as port:
        with proxy_before(port, rate, seed) as (faulty, counts):
            yield f"{program.bucket}/rooms", faulty, str(port)
        print(f"requests: {counts}", flush=True)


@contextmanager
def proxy_before(port: int, rate: float, seed: int = 0) -> Iterator[tuple[str, dict[str, int]]]:
    """Start the proxy.

    Args:
        port: Of the store.
        rate: Share of the requests with a fault.
        seed: Of the faults.

    Yields:
        Port of the proxy, and what it counts, which is filled at the end.
    """
    program = [sys.executable, str(Path(__file__).with_name("misbehaving_proxy.py"))]
    options = ["--store-port", str(port), "--rate", str(rate), "--seed", str(seed)]
    counts: dict[str, int] = {}
    with subprocess.Popen([*program, *options], stdout=subprocess.PIPE, text=True) as proxy:
        assert proxy.stdout is not None
        try:
            yield proxy.stdout.readline().strip(), counts
        finally:
            proxy.terminate()
            counts |= json.loads(proxy.stdout.read())


def prepare(folder: Path, url: str) -> None:
    """Write a map, share it, and clone it for each robot."""
    write_rooms(folder / "robot0")
    push_map(folder / "robot0", url)
    for number in range(1, ROBOTS):
        clone_map(url, folder / f"robot{number}")


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--store", choices=(*PROGRAMS, "folder"), default="azurite")
    parser.add_argument("--moments", type=int, default=500, help="kills of all robots")
    parser.add_argument("--rate", type=float, default=0.2, help="share of requests with a fault")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        bucket = shared_map(arguments.store, folder / "bucket", arguments.rate, arguments.seed)
        program = PROGRAMS.get(arguments.store, AZURITE)  # A folder needs no environment.
        with bucket as (url, faulty, direct):
            os.environ.update(program.environment(direct))
            # The network library of a process that used it does not work in its children.
            made = run_disturbed(folder, lambda: prepare(folder, url))
            if made.code != 0:
                raise RuntimeError(f"the map cannot be shared: {made.summary}")
            os.environ.update(program.environment(faulty))
            robots = disturb(folder, url, arguments.moments, arguments.seed)
            os.environ.update(program.environment(direct))
            problems = find_problems(folder, url, robots)
            with open_map(robots[0].folder) as store:
                versions = len(store.versions())
            given_up = 0
            for robot in robots:
                os.environ[VARIABLE] = robot.name
                given_up += len(given_up_rounds(robot.folder))
    for problem in problems[:MAX_SHOWN]:
        print(problem, file=sys.stderr)
    print("| store | runs | killed | pushes that failed | versions | given up | problems |")
    print("| --- | ---: | ---: | ---: | ---: | ---: | ---: |")
    counts = [sum(getattr(r, field) for r in robots) for field in ("runs", "killed", "failed")]
    row = (arguments.store, *counts, versions, given_up, len(problems))
    print(f"| {' | '.join(map(str, row))} |")
    sys.exit(bool(problems))


if __name__ == "__main__":
    main()
