"""What is disturbed: programs that write maps, and what must be true after them, however they end.

A subject works in a folder of its own.
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

# Children need not import what is imported here.
import made_up
import matplotlib.backends.backend_svg  # noqa: F401
from disturbed import Outcome, disturbed

import gslts.mapping.engine
import gslts.mapping.report.page
import gslts.mapping.report.summary
from gslts.cli import main
from gslts.core.gaussian_map import GaussianMap
from gslts.io.ply import write_ply
from gslts.keeper.state import read_state
from gslts.localization.landmark_files import FOLDER as LANDMARKS
from gslts.localization.landmark_files import landmark_problems
from gslts.store.delta import map_to_arrays
from gslts.store.manifest import CAMERAS, MANIFEST
from gslts.store.map_folder import open_map
from gslts.store.map_store import BLOBS, INDEX
from gslts.store.writer_lock import LOCK

MAP = "map"
OWN_FILES = {MANIFEST, CAMERAS, BLOBS, INDEX, f"{INDEX}-wal", f"{INDEX}-shm", LOCK}
"""Of every map; what begins with a dot is not looked at by anything."""


class Subject(Protocol):
    """A program that writes a map."""

    name: str

    def prepare(self, folder: Path, *, fresh: bool) -> None:
        """Makes what a run starts from.

        Args:
            folder: Where it works.
            fresh: Whether nothing of an earlier run may be left.
        """

    def run(self) -> None:
        """Runs in the folder, as a process of its own."""

    def problems(self, folder: Path, outcome: Outcome) -> list[str]:
        """What is wrong after a run, in one line each."""


class Commits:
    """`made_up.py`, which commits some versions more.

    Args:
        more: So many.
    """

    name = "commits"
    MOST = 60

    def __init__(self, more: int) -> None:
        self._more = more

    def prepare(self, folder: Path, *, fresh: bool) -> None:
        """A map that has few versions enough."""
        path = folder / MAP
        if fresh or not path.exists() or newest_of(path) > self.MOST:
            emptied(folder)
            made_up.write_first(path)

    def run(self) -> None:
        """Goes on from the newest version."""
        sys.argv = ["made_up.py", MAP, "--more", str(self._more)]
        made_up.main()

    def problems(self, folder: Path, outcome: Outcome) -> list[str]:
        """Every version is what was known in advance, and those that were told are there."""
        path, told = folder / MAP, [int(line) for line in outcome.out.split()]
        found = wrong_of_map(path, told, lambda number: digest(made_up.map_of(number)))
        if found:
            return found
        newest, state = newest_of(path), path / made_up.STATE
        if state.exists() and json.loads(state.read_text())["version"] > newest:
            found.append(f"{state.name} tells of a version that is not there")
        with open_map(path) as store:
            known = [event.version for event in store.events()]
        updates = [one for one in range(2, newest + 1) if made_up.restored_by(one) is None]
        if known != updates:
            found.append(f"of versions {updates}, {known} tell what became of objects")
        if told and outcome.failures == 1 and newest != told[0] + self._more - 1:
            found.append("it did not go on after an error that passed")
        return found + foreign_in(path, {made_up.STATE})


class NewMap:
    """A command that makes a map: it is there whole or not at all, and may be made again.

    Args:
        name: Of the subject.
        arguments: Of the command, without --out.
    """

    def __init__(self, name: str, arguments: Sequence[str]) -> None:
        self.name = name
        self._arguments = [*arguments, "--out", MAP]
        self._expected: str | None = None

    def prepare(self, folder: Path, *, fresh: bool) -> None:
        """An empty folder, but for what stopped runs left there that nothing looks at."""
        for path in folder.iterdir():
            if fresh or not path.name.startswith("."):
                removed(path)
        if self._expected is None:
            self._again(folder)
            self._expected = digest_of(folder / MAP)
            emptied(folder)

    def run(self) -> None:
        """A checkpoint is written as often as can be."""
        gslts.mapping.engine.SAVE_EVERY_S = 0.0
        resumed = ["--resume"] if Path(f"{MAP}.checkpoint.npz").exists() else []
        sys.argv = ["gslts", *self._arguments, *resumed]
        main()

    def problems(self, folder: Path, outcome: Outcome) -> list[str]:
        """The map is there and the same as ever, or is when the command is run again."""
        path = folder / MAP
        found = foreign_in(folder, {MAP, f"{MAP}.checkpoint.npz"})
        if outcome.code == 0 and not path.exists():
            found.append("it ended well, and there is no map")
        if not path.exists() and not found:
            found += self._again(folder)
        if not found:
            found += wrong_of_map(path, [1], lambda _: self._expected or "")
            found += foreign_in(path, {"report.html", LANDMARKS})
        return found

    def _again(self, folder: Path) -> list[str]:
        done = disturbed(folder, self.run)
        if done.code != 0:
            return [f"it cannot be run again: {done.told}"]
        left = [path.name for path in folder.iterdir() if path.name != MAP]
        return [f"run again, it leaves {left}"] if left else []


class Command:
    """Any command that adds versions to a map.

    Args:
        given: The map.
        arguments: Of the command, with {map} where the map is named; with paths that are absolute.
        told: Finds the numbers of versions in what it prints when they are committed.
    """

    name = "command"

    def __init__(self, given: Path, arguments: Sequence[str], told: str) -> None:
        self._given = given
        self._arguments = [one.replace("{map}", MAP) for one in arguments]
        self._told = re.compile(told)
        self._known: dict[int, str] = {}

    def prepare(self, folder: Path, *, fresh: bool) -> None:
        """A copy of the map, or what an earlier run left of it."""
        if fresh or not (folder / MAP).exists():
            emptied(folder)
            shutil.copytree(self._given, folder / MAP)
            self._known = {}

    def run(self) -> None:
        """Becomes the command."""
        os.execvp(self._arguments[0], self._arguments)

    def problems(self, folder: Path, outcome: Outcome) -> list[str]:
        """Versions that were there once are still there, and those that were told are."""
        told = [int(one[1]) for one in self._told.finditer(outcome.out)]
        return wrong_of_map(
            folder / MAP,
            [*told, *self._known],
            lambda number: self._known.get(number),
            self._known.__setitem__,
        )


class Rounds(Command):
    """`gslts run` of a day in which two objects change.

    Args:
        inputs: From `write_home`.
    """

    name = "run"

    def __init__(self, inputs: Path) -> None:
        day = str((inputs / "day" / "day.json").resolve())
        arguments = ["run", "{map}", "--robot", day, "--iterations", "10", "--threads", "1"]
        super().__init__(inputs / "home", arguments, r"(?m)^version (\d+): ")

    def run(self) -> None:
        """Goes on where the one before was killed."""
        sys.argv = ["gslts", *self._arguments]
        main()

    def problems(self, folder: Path, outcome: Outcome) -> list[str]:
        """Once it ends well, the day is over."""
        found = super().problems(folder, outcome)
        if outcome.code == 0 and (days := read_state(folder / MAP).round) != 2:
            found.append(f"it ended after {days} of 2 rounds")
        return found


def wrong_of_map(
    path: Path,
    needed: Iterable[int],
    expected: Callable[[int], str | None],
    found_out: Callable[[int, str], None] = lambda *_: None,
) -> list[str]:
    """What is wrong with a map.

    Args:
        path: Its folder.
        needed: Versions that it must hold.
        expected: The digest of a version; None if it is not known.
        found_out: Is told of those that are there.
    """
    wrong = []
    try:
        with open_map(path) as store:
            wrong += store.find_problems() + landmark_problems(store)
            numbers = [version.number for version in store.versions()]
            if numbers != list(range(1, len(numbers) + 1)):
                wrong.append(f"its versions are {numbers}")
            wrong += [f"version {one} is lost" for one in needed if one not in numbers]
            for version in store.versions():
                gaussian_map = store.read(version.number)
                is_, should_be = digest(gaussian_map), expected(version.number)
                if gaussian_map.size != version.gaussians or should_be not in (None, is_):
                    wrong.append(f"version {version.number} is another one")
                found_out(version.number, is_)
        open_map(path, writable=True).close()
    except Exception as error:
        wrong.append(f"{type(error).__name__}: {error}")
    return wrong


def digest(gaussian_map: GaussianMap) -> str:
    """The same for maps that are the same bit by bit."""
    content = hashlib.sha256()
    for name, array in map_to_arrays(gaussian_map).items():
        content.update(f"{name} {array.dtype} {array.shape}".encode() + array.tobytes())
    return content.hexdigest()


def digest_of(path: Path) -> str:
    """Of the newest version of a map."""
    with open_map(path) as store:
        return digest(store.read())


def newest_of(path: Path) -> int:
    """The number of the newest version of a map."""
    with open_map(path) as store:
        return store.version().number


def foreign_in(folder: Path, known: set[str]) -> list[str]:
    """What nobody should have put there."""
    return [
        f"{path.name} is there"
        for path in sorted(folder.iterdir())
        if path.name not in known | OWN_FILES and not path.name.startswith(".")
    ]


def emptied(folder: Path) -> None:
    """Leaves nothing in a folder."""
    for path in folder.iterdir():
        removed(path)


def removed(path: Path) -> None:
    """Removes a file or a folder."""
    if path.is_dir():
        shutil.rmtree(path)
    else:
        path.unlink()


def write_inputs(visit: Path, ply: Path) -> None:
    """A tiny data set and a PLY file, to make maps of."""
    write_ply(made_up.map_of(1), ply)
    size = ["--frames", "12", "--width", "64", "--height", "48"]
    prepared(visit.parent, ["sim", "capture", "kitchen", "0", "--out", str(visit), *size])


def write_home(inputs: Path) -> None:
    """A small day and a rough map of the home before it."""
    size = ["--frames", "60", "--width", "240", "--height", "180", "--changes", "2"]
    prepared(inputs, ["sim", "day", "living_room", "7", "--out", str(inputs / "day"), *size])
    rough = ["--preset", "fast", "--iterations", "300", "--set", "variant_steps=0"]
    before, home = str(inputs / "day" / "before"), str(inputs / "home")
    prepared(inputs, ["map", before, "--out", home, *rough])


def prepared(folder: Path, arguments: Sequence[str]) -> None:
    """Runs a command that nobody disturbs."""

    def run() -> None:
        sys.argv = ["gslts", *arguments]
        main()

    done = disturbed(folder, run)
    if done.code != 0:
        raise RuntimeError(f"there is nothing to disturb: gslts {arguments[0]} {done.told}")
