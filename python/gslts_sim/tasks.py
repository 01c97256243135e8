"""Scene change tasks by the hundred: balanced over kinds of change and types of objects.

All tasks of a home share its default state, so that one map serves them all; some objects are kept
out of it for additions.

Source: GS-LTS, sec. IV-A, Scene Change Adaptation Benchmark.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from gslts_sim.change_sampler import NoTaskError, TaskSettings, Traversal
from gslts_sim.home import Home, HomeObject
from gslts_sim.home_source import FILE_TYPES, FileSource, HomeSource, require_room_type
from gslts_sim.task import Kind, Task

KINDS: tuple[Kind, ...] = ("addition", "removal", "relocation")

TRIES_PER_TASK = 12
"""Changes that are tried for each task that a home is to give."""
PATIENCE = 5
"""So many changes of a kind may fail in a home before other kinds get ahead by one task."""
FRUITLESS_HOMES = 10
"""After so many homes in a row that give no task, there will be none."""
LABEL_CHARACTERS = 60


def generate_tasks(
    names: list[str], folder: Path, first_seed: int, count: int, per_home: int, maker: TaskMaker
) -> Iterator[Task]:
    """Tasks of many homes, as long as homes give some.

    Args:
        names: Room types, each for homes of rising seeds, and files, each for one home.
        folder: Of the scripts; they tell where the files are from there.
        first_seed: Of the first home.
        count: How many tasks.
        per_home: Of each home, at most.
        maker: Makes them.

    Raises:
        OSError: A file cannot be read.
        ValueError: There is no such room type, a file is no home, or the setting asks for an object
            or receptacle that a home does not have.
    """
    made = fruitless = 0
    for source, home in homes_of(names, folder, first_seed):
        tasks = maker.make(source, home, min(per_home, count - made))
        yield from tasks
        made += len(tasks)
        fruitless = 0 if tasks else fruitless + 1
        if made == count or fruitless == FRUITLESS_HOMES:
            return


def homes_of(
    names: list[str], folder: Path, first_seed: int
) -> Iterator[tuple[HomeSource | FileSource, Home]]:
    """The homes of room types and files in turn; files are all read before the first home."""
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
    """The name of a task's file."""
    label = re.sub(r"[^A-Za-z0-9_.]+", "-", task.change.object_id)[:LABEL_CHARACTERS]
    return f"{number:04}_{task.change.kind}_{label}.json"


class TaskMaker:
    """Makes tasks, as many of each kind, and of every type of object if it can.

    Args:
        setting: What they have in common.
        seed: Same seed and same homes, same tasks.

    Attributes:
        refused: How often changes were refused, for each reason.
    """

    def __init__(self, setting: TaskSettings, seed: int) -> None:
        self.rejected: Counter[str] = Counter()
        self._setting, self._seed = setting, seed
        self._homes = 0
        self._kinds: Counter[Kind] = Counter()
        self._types: Counter[str] = Counter()

    def make(self, source: HomeSource | FileSource, home: Home, count: int) -> list[Task]:
        """Up to `count` tasks of a home, which all start from one state of it.

        Raises:
            ValueError: The setting asks for an object or receptacle that the first home lacks;
                later ones without it give no tasks.
        """
        rng = self._rng_of_next_home()
        try:
            traversal = Traversal(home, self._setting, rng)
        except ValueError as reason:
            if self._homes == 1:
                raise
            self.rejected[str(reason)] += 1
            return []
        tasks: list[Task] = []
        left = {kind: traversal.objects(kind) for kind in KINDS}
        failures: Counter[Kind] = Counter()
        for _ in range(TRIES_PER_TASK * count):
            if len(tasks) == count or not any(left.values()):
                break
            tasks += self._tried(source, traversal, left, failures, rng)
        return tasks

    def make_sequence(
        self, source: HomeSource | FileSource, home: Home, count: int
    ) -> Iterator[Task]:
        """Up to `count` tasks of a home, each of which starts where the one before ended.

        The first one starts as those of `make`.

        Raises:
            ValueError: The setting asks for an object or receptacle that the home lacks.
        """
        rng = self._rng_of_next_home()
        traversal = Traversal(home, self._setting, rng)
        failures: Counter[Kind] = Counter()
        made = 0
        left: dict[Kind, list[HomeObject]] = {}
        for _ in range(TRIES_PER_TASK * count):
            if not any(left.values()):  # All were tried, and may find another place.
                left = {kind: traversal.objects(kind) for kind in KINDS}
            if not any(left.values()):
                return
            for task in self._tried(source, traversal, left, failures, rng, once=True):
                yield task
                made += 1
                if made == count:
                    return
                traversal = traversal.advance(task)
                left = {}

    def _rng_of_next_home(self) -> np.random.Generator:
        self._homes += 1
        return np.random.default_rng([self._seed, self._homes - 1])

    def _tried(
        self,
        source: HomeSource | FileSource,
        traversal: Traversal,
        left: dict[Kind, list[HomeObject]],
        failures: Counter[Kind],
        rng: np.random.Generator,
        *,
        once: bool = False,
    ) -> list[Task]:
        """The task of the change that is due, if it makes one; `once` does not try it again."""
        # The kind that is behind, unless this home keeps refusing it.
        kind = min(
            (kind for kind in KINDS if left[kind]),
            key=lambda name: self._kinds[name] + failures[name] // PATIENCE,
        )
        due = [thing for thing in left[kind] if self._type_is_due(thing.type)] or left[kind]
        thing = due[rng.integers(len(due))]
        try:
            task = traversal.task(source, traversal.trial(kind, thing))
        except NoTaskError as reason:
            self.rejected[str(reason)] += 1
            failures[kind] += 1
            if once or kind == "removal":  # Nothing about a removal could turn out otherwise.
                left[kind].remove(thing)
            return []
        self._kinds[kind] += 1
        self._types[thing.type] += 1
        if kind == "removal" or self._setting.object_id is None:
            left[kind].remove(thing)
        return [task]

    def _type_is_due(self, name: str) -> bool:
        """Whether a type has not had more than its share yet."""
        mean = self._types.total() / max(1, len(self._types))
        return self._types[name] <= mean
