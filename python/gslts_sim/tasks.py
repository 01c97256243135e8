"""Sets of scene change tasks, balanced over the kinds of change and the types of objects.

All tasks of a home share its default state, so that one map serves them all; some objects are
withheld from that state, so that there is something to add.

Source: GS-LTS, sec. IV-A, Scene Change Adaptation Benchmark.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from gslts_sim.change_sampler import ChangeSampler, TaskSettings
from gslts_sim.home import Home, HomeObject
from gslts_sim.home_source import FILE_TYPES, FileSource, HomeSource, require_room_type
from gslts_sim.task import Kind, Task
from gslts_sim.task_viewpoints import NoTaskError

KINDS: tuple[Kind, ...] = ("addition", "removal", "relocation")
"""All kinds of change, in the order of ties."""
MAX_TRIES_PER_TASK = 12
"""Maximum number of changes that are tried in a home, per task that is asked for."""
MAX_FAILURES_PER_TASK = 5
"""Failures of one kind in a home after which that kind falls back by one task; larger values keep
the kinds more balanced and take longer."""
MAX_FRUITLESS_HOMES = 10
"""Maximum number of homes without a task in a row, after which the search ends."""
MAX_LABEL_LENGTH = 60
"""Maximum length of an object's id in the name of a file, characters."""


def generate_tasks(
    names: list[str], folder: Path, first_seed: int, count: int, per_home: int, maker: TaskMaker
) -> Iterator[Task]:
    """Generate tasks in many homes; end early when homes give no more.

    Args:
        names: Room types, each for homes of rising seeds, and files, each for one home.
        folder: Of the scripts; paths of files are relative to it.
        first_seed: Of the first home.
        count: Number of tasks.
        per_home: Maximum number of tasks of one home.
        maker: Makes the tasks of a home.

    Yields:
        Tasks.

    Raises:
        OSError: A file cannot be read.
        ValueError: There is no such room type, a file is not a home, or the settings ask for an
            object or receptacle that a home does not have.
    """
    done = fruitless = 0
    for source, home in homes_of(names, folder, first_seed):
        tasks = maker.make(source, home, min(per_home, count - done))
        yield from tasks
        done += len(tasks)
        fruitless = 0 if tasks else fruitless + 1
        if done == count or fruitless == MAX_FRUITLESS_HOMES:
            return


def homes_of(
    names: list[str], folder: Path, first_seed: int
) -> Iterator[tuple[HomeSource | FileSource, Home]]:
    """Generate homes of room types and files in turn, after all files were read.

    Args:
        names: Room types, each for homes of rising seeds, and files, each for one home.
        folder: Of the scripts; paths of files are relative to it.
        first_seed: Of the first home of each room type.

    Yields:
        The reference to a home, and the home; without end if there is a room type.

    Raises:
        OSError: A file cannot be read.
        ValueError: There is no such room type, or a file is not a home.
    """
    files = {
        name: FileSource.of_path(Path(name), folder)
        for name in names
        if Path(name).suffix.lower() in FILE_TYPES
    }
    types = [name for name in names if name not in files]
    for name in types:
        require_room_type(name)
    yield from files.values()
    seed = first_seed
    while types:
        for name in types:
            yield HomeSource.of_seed(name, seed)
        seed += 1


def script_name(number: int, task: Task) -> str:
    """Return the name of a task's file.

    Args:
        number: Of the task.
        task: The task.
    """
    label = re.sub(r"[^A-Za-z0-9_.]+", "-", task.change.object_id)[:MAX_LABEL_LENGTH]
    return f"{number:04}_{task.change.kind}_{label}.json"


class TaskMaker:
    """Makes equally many tasks of each kind, and of each type of object where possible.

    Args:
        settings: Settings that all tasks share.
        seed: Same seed and same homes, same tasks.

    Attributes:
        rejected: Number of rejected changes for each reason.
    """

    def __init__(self, settings: TaskSettings, seed: int) -> None:
        self.rejected: Counter[str] = Counter()
        self._settings, self._seed = settings, seed
        self._homes = 0
        self._kinds: Counter[Kind] = Counter()
        self._types: Counter[str] = Counter()

    def make(self, source: HomeSource | FileSource, home: Home, count: int) -> list[Task]:
        """Make tasks of a home that all start from its default state.

        Args:
            source: Reference to the home.
            home: The home.
            count: Maximum number of tasks.

        Returns:
            The tasks; fewer than `count` if too many changes are impossible.

        Raises:
            ValueError: The settings ask for an object or receptacle that the first home does not
                have; later homes without it give no tasks.
        """
        rng = self._rng_of_next_home()
        try:
            sampler = ChangeSampler(home, self._settings, rng)
        except ValueError as reason:
            if self._homes == 1:
                raise
            self.rejected[str(reason)] += 1
            return []
        tasks: list[Task] = []
        left = {kind: sampler.objects(kind) for kind in KINDS}
        failures: Counter[Kind] = Counter()
        for _ in range(MAX_TRIES_PER_TASK * count):
            if len(tasks) == count or not any(left.values()):
                break
            tasks += self._try(source, sampler, left, failures, rng)
        return tasks

    def make_sequence(
        self, source: HomeSource | FileSource, home: Home, count: int
    ) -> Iterator[Task]:
        """Generate tasks of a home, each of which starts where the previous one ended.

        The first one starts as those of `make`.

        Args:
            source: Reference to the home.
            home: The home.
            count: Maximum number of tasks.

        Yields:
            Tasks.

        Raises:
            ValueError: The settings ask for an object or receptacle that the home does not have.
        """
        rng = self._rng_of_next_home()
        sampler = ChangeSampler(home, self._settings, rng)
        failures: Counter[Kind] = Counter()
        done = 0
        left: dict[Kind, list[HomeObject]] = {}
        for _ in range(MAX_TRIES_PER_TASK * count):
            if not any(left.values()):  # All were tried; another draw may succeed.
                left = {kind: sampler.objects(kind) for kind in KINDS}
            if not any(left.values()):
                return
            for task in self._try(source, sampler, left, failures, rng, once=True):
                yield task
                done += 1
                if done == count:
                    return
                sampler = sampler.advance(task)
                left = {}

    def _rng_of_next_home(self) -> np.random.Generator:
        self._homes += 1
        return np.random.default_rng([self._seed, self._homes - 1])

    def _try(
        self,
        source: HomeSource | FileSource,
        sampler: ChangeSampler,
        left: dict[Kind, list[HomeObject]],
        failures: Counter[Kind],
        rng: np.random.Generator,
        *,
        once: bool = False,
    ) -> list[Task]:
        """Try the change that is due.

        Args:
            source: Reference to the home.
            sampler: Of the home.
            left: Objects of each kind that may still be tried; updated.
            failures: Number of failures of each kind in this home; updated.
            rng: Source of randomness.
            once: Do not try an object again after a failure.

        Returns:
            The task, or an empty list if the change is rejected.
        """
        # The kind with the fewest tasks, unless it keeps failing in this home.
        kind = min(
            (kind for kind in KINDS if left[kind]),
            key=lambda name: self._kinds[name] + failures[name] // MAX_FAILURES_PER_TASK,
        )
        due = [obj for obj in left[kind] if self._type_is_due(obj.type)] or left[kind]
        obj = due[rng.integers(len(due))]
        try:
            task = sampler.task(source, sampler.propose(kind, obj))
        except NoTaskError as reason:
            self.rejected[str(reason)] += 1
            failures[kind] += 1
            if once or kind == "removal":  # Another draw of a removal would be the same.
                left[kind].remove(obj)
            return []
        self._kinds[kind] += 1
        self._types[obj.type] += 1
        if kind == "removal" or self._settings.object_id is None:
            left[kind].remove(obj)
        return [task]

    def _type_is_due(self, name: str) -> bool:
        """Return whether a type has had no more tasks than the mean."""
        mean = self._types.total() / max(1, len(self._types))
        return self._types[name] <= mean
