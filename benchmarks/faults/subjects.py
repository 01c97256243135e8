"""Programs that write maps, and the checks of their maps after any end.

A subject works in its own folder.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import shutil
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Protocol

import matplotlib.backends.backend_svg  # noqa: F401

# Modules that are imported here are not imported by the children.
import synthetic_versions
from fault_injection import Outcome, run_disturbed

import gslts.mapping.engine
import gslts.mapping.report.page
import gslts.mapping.report.summary
from gslts.cli import main
from gslts.core.gaussian_map import GaussianMap
from gslts.io.ply import write_ply
from gslts.keeper.state import read_state
from gslts.localization.landmark_files import LANDMARK_FILES, read_landmark_file
from gslts.store.delta import map_to_arrays
from gslts.store.manifest import CAMERAS, MANIFEST
from gslts.store.map_folder import open_map
from gslts.store.map_store import BLOBS, INDEX
from gslts.store.measurement_files import MEASUREMENT_FILES, read_measurement_file
from gslts.store.writer_lock import LOCK

MAP = "map"
"""Name of the map in the folder of a subject."""
OWN_FILES = {MANIFEST, CAMERAS, BLOBS, INDEX, f"{INDEX}-wal", f"{INDEX}-shm", LOCK}
"""Files of every map; names that begin with a dot are ignored by all programs."""


class Subject(Protocol):
    """A program that writes a map."""

    name: str

    def prepare(self, folder: Path, *, fresh: bool) -> None:
        """Make the input of a run.

        Args:
            folder: Of the subject.
            fresh: Remove everything of earlier runs.
        """

    def run(self) -> None:
        """Run in the folder, as a child process."""

    def problems(self, folder: Path, outcome: Outcome) -> list[str]:
        """Check the map after a run.

        Args:
            folder: Of the subject.
            outcome: Of the run.

        Returns:
            One line per problem.
        """


class Commits:
    """`synthetic_versions.py`, which commits versions.

    Args:
        more: Number of versions per run.
    """

    name = "commits"
    MAX_VERSIONS = 60

    def __init__(self, more: int) -> None:
        self._more = more

    def prepare(self, folder: Path, *, fresh: bool) -> None:
        """Make a map with few versions."""
        path = folder / MAP
        if fresh or not path.exists() or newest_of(path) > self.MAX_VERSIONS:
            empty(folder)
            synthetic_versions.write_first(path)

    def run(self) -> None:
        """Continue from the newest version."""
        sys.argv = ["synthetic_versions.py", MAP, "--more", str(self._more)]
        synthetic_versions.main()

    def problems(self, folder: Path, outcome: Outcome) -> list[str]:
        """Check that every version is as expected, and that all reported versions exist."""
        path, reported = folder / MAP, [int(line) for line in outcome.stdout.split()]
        found = check_map(
            path, reported, lambda number: digest(synthetic_versions.expected_map(number))
        )
        if found:
            return found
        newest, state = newest_of(path), path / synthetic_versions.STATE
        if state.exists() and json.loads(state.read_text())["version"] > newest:
            found.append(f"{state.name} names a version that does not exist")
        with open_map(path) as store:
            known = [event.version for event in store.events()]
        restored = synthetic_versions.restored_version
        updates = [number for number in range(2, newest + 1) if restored(number) is None]
        if known != updates:
            found.append(f"versions {updates} are updates, but {known} have object changes")
        if reported and outcome.failures == 1 and newest != reported[0] + self._more - 1:
            found.append("it did not continue after an error that passed")
        return found + foreign_in(path, {synthetic_versions.STATE})


class NewMap:
    """A command that makes a map: it is complete or does not exist, and can be made again.

    Args:
        name: Of the subject.
        arguments: Of the command, without --out.
    """

    def __init__(self, name: str, arguments: Sequence[str]) -> None:
        self.name = name
        self._arguments = [*arguments, "--out", MAP]
        self._expected: str | None = None

    def prepare(self, folder: Path, *, fresh: bool) -> None:
        """Empty the folder, except for hidden remains of killed runs."""
        for path in folder.iterdir():
            if fresh or not path.name.startswith("."):
                remove(path)
        if self._expected is None:
            self._again(folder)
            self._expected = digest_of(folder / MAP)
            empty(folder)

    def run(self) -> None:
        """Write checkpoints as often as possible."""
        gslts.mapping.engine.SAVE_EVERY_S = 0.0
        resumed = ["--resume"] if Path(f"{MAP}.checkpoint.npz").exists() else []
        sys.argv = ["gslts", *self._arguments, *resumed]
        main()

    def problems(self, folder: Path, outcome: Outcome) -> list[str]:
        """Check that the map is as expected, or is after the command is run again."""
        path = folder / MAP
        found = foreign_in(folder, {MAP, f"{MAP}.checkpoint.npz"})
        if outcome.code == 0 and not path.exists():
            found.append("it succeeded without a map")
        if not path.exists() and not found:
            found += self._again(folder)
        if not found:
            found += check_map(path, [1], lambda _: self._expected or "")
            found += foreign_in(path, {"report.html", LANDMARK_FILES.kind, MEASUREMENT_FILES.kind})
        return found

    def _again(self, folder: Path) -> list[str]:
        done = run_disturbed(folder, self.run)
        if done.code != 0:
            return [f"it cannot be run again: {done.summary}"]
        left = [path.name for path in folder.iterdir() if path.name != MAP]
        return [f"run again, it leaves {left}"] if left else []


class Command:
    """Any command that adds versions to a map.

    Args:
        given: The map.
        arguments: Of the command, with {map} for the map, and with absolute paths.
        reported: Regular expression of the version numbers that it prints after commits.
    """

    name = "command"

    def __init__(self, given: Path, arguments: Sequence[str], reported: str) -> None:
        self._given = given
        self._arguments = [argument.replace("{map}", MAP) for argument in arguments]
        self._reported = re.compile(reported)
        self._known: dict[int, str] = {}

    def prepare(self, folder: Path, *, fresh: bool) -> None:
        """Copy the map, or continue with what an earlier run left."""
        if fresh or not (folder / MAP).exists():
            empty(folder)
            shutil.copytree(self._given, folder / MAP)
            self._known = {}

    def run(self) -> None:
        """Replace the process by the command."""
        os.execvp(self._arguments[0], self._arguments)

    def problems(self, folder: Path, outcome: Outcome) -> list[str]:
        """Check that no version is lost, and that all reported versions exist."""
        reported = [int(match[1]) for match in self._reported.finditer(outcome.stdout)]
        return check_map(
            folder / MAP,
            [*reported, *self._known],
            lambda number: self._known.get(number),
            self._known.__setitem__,
        )


class Rounds(Command):
    """`gslts run` of a day with two object changes.

    Args:
        inputs: From `write_home`.
    """

    name = "run"

    def __init__(self, inputs: Path) -> None:
        day = str((inputs / "day" / "day.json").resolve())
        arguments = ["run", "{map}", "--robot", day, "--iterations", "10", "--threads", "1"]
        super().__init__(inputs / "home", arguments, r"(?m)^version (\d+): ")

    def run(self) -> None:
        """Continue where the previous run was killed."""
        sys.argv = ["gslts", *self._arguments]
        main()

    def problems(self, folder: Path, outcome: Outcome) -> list[str]:
        """Check that all rounds are done after a success."""
        found = super().problems(folder, outcome)
        if outcome.code == 0 and (days := read_state(folder / MAP).round) != 2:
            found.append(f"it ended after {days} of 2 rounds")
        return found


def check_map(
    path: Path,
    needed: Iterable[int],
    expected: Callable[[int], str | None],
    on_version: Callable[[int, str], None] = lambda *_: None,
) -> list[str]:
    """Check a map.

    Args:
        path: Its folder.
        needed: Numbers of versions that it must hold.
        expected: Returns the digest of a version; None if it is unknown.
        on_version: Called with number and digest of each version.

    Returns:
        One line per problem.
    """
    wrong = []
    try:
        with open_map(path) as store:
            wrong += store.find_problems()
            wrong += LANDMARK_FILES.find_problems(store, read_landmark_file)
            wrong += MEASUREMENT_FILES.find_problems(store, read_measurement_file)
            numbers = [version.number for version in store.versions()]
            if numbers != list(range(1, len(numbers) + 1)):
                wrong.append(f"its versions are {numbers}")
            wrong += [f"version {number} is lost" for number in needed if number not in numbers]
            for version in store.versions():
                gaussian_map = store.read(version.number)
                is_, should_be = digest(gaussian_map), expected(version.number)
                if gaussian_map.size != version.gaussians or should_be not in (None, is_):
                    wrong.append(f"version {version.number} differs")
                on_version(version.number, is_)
        open_map(path, writable=True).close()
    except Exception as error:
        wrong.append(f"{type(error).__name__}: {error}")
    return wrong


def digest(gaussian_map: GaussianMap) -> str:
    """Return a digest of all bits of a map."""
    content = hashlib.sha256()
    for name, array in map_to_arrays(gaussian_map).items():
        content.update(f"{name} {array.dtype} {array.shape}".encode() + array.tobytes())
    return content.hexdigest()


def digest_of(path: Path) -> str:
    """Return the digest of the newest version of a map."""
    with open_map(path) as store:
        return digest(store.read())


def newest_of(path: Path) -> int:
    """Return the number of the newest version of a map."""
    with open_map(path) as store:
        return store.version().number


def foreign_in(folder: Path, known: set[str]) -> list[str]:
    """Return the unexpected files of a folder."""
    return [
        f"{path.name} is there"
        for path in sorted(folder.iterdir())
        if path.name not in known | OWN_FILES and not path.name.startswith(".")
    ]


def empty(folder: Path) -> None:
    """Empty a folder."""
    for path in folder.iterdir():
        remove(path)


def remove(path: Path) -> None:
    """Remove a file or a folder."""
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink()


def write_inputs(visit: Path, ply: Path) -> None:
    """Write a tiny recording and a PLY file."""
    write_ply(synthetic_versions.expected_map(1), ply)
    size = ["--frames", "12", "--width", "64", "--height", "48"]
    run_command(visit.parent, ["sim", "capture", "kitchen", "0", "--out", str(visit), *size])


def write_home(inputs: Path) -> None:
    """Write a small day, and a rough map of the home before it."""
    size = ["--frames", "60", "--width", "240", "--height", "180", "--changes", "2"]
    run_command(inputs, ["sim", "day", "living_room", "7", "--out", str(inputs / "day"), *size])
    rough = ["--preset", "fast", "--iterations", "300", "--set", "variant_steps=0"]
    before, home = str(inputs / "day" / "before"), str(inputs / "home")
    run_command(inputs, ["map", before, "--out", home, *rough])


def run_command(folder: Path, arguments: Sequence[str]) -> None:
    """Run a command without faults."""

    def run() -> None:
        sys.argv = ["gslts", *arguments]
        main()

    done = run_disturbed(folder, run)
    if done.code != 0:
        raise RuntimeError(f"the input cannot be made: gslts {arguments[0]} {done.summary}")
