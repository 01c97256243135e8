"""Navigation to objects that were moved after mapping, detected, and brought into the map."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from gslts.change.detector import ChangeDetector
from gslts.core.camera import Camera
from gslts.core.gaussian_map import GaussianMap
from gslts.navigation.navigator import Navigator
from gslts.semantics.map_semantics import MapSemantics
from gslts.semantics.source import Oracle
from gslts.store.camera_files import cameras_of_map
from gslts.update.config import UpdateConfig
from gslts.update.updater import update
from gslts_bench.cache import code_digest, digest, native_digest
from gslts_bench.detection.run import report_of
from gslts_bench.detection.score import fits
from gslts_bench.homes import MAP_S, RECORDING_S, BenchHome
from gslts_bench.navigation.episodes import Episode, starts_to
from gslts_bench.navigation.run import Ground, Record, gone, record_of
from gslts_bench.navigation.truth import Truth
from gslts_bench.queries.semantic_homes import SEMANTICS_S, TaughtMap, taught
from gslts_bench.work import Add, Result, Tell, message_of, validated
from gslts_sim.home import Home
from gslts_sim.task import Task

WALKS = 3
"""To each object, from different places."""
TASKS_FOR_ONE = 6
"""So many tasks of a home are made for each wanted: a third are relocations."""
NOT_UPDATED = "not updated"
"""Status where the change was not detected in the first frame, or its update was rejected."""
TASK_S = 20.0
"""About how long one takes, for the progress."""


@dataclass(frozen=True)
class MovedUnit:
    """One home, in which objects are relocated one at a time.

    Attributes:
        bench: The home.
        tasks: How many relocations, of objects that are the only ones of their type.
        code: Digests of the code that decides results; see `HomeSetup`.
    """

    bench: BenchHome
    tasks: int
    code: dict[str, Any] = field(
        default_factory=lambda: {
            "python": code_digest(__name__),
            "native": native_digest(),
        }
    )

    @property
    def name(self) -> str:
        """That of the home, with what happens in it."""
        return f"{self.bench.name}, moved"

    @cached_property
    def results(self) -> Path:
        """The file of records; another one when anything that decides them is another."""
        key = digest({"map": self.bench.mapped_of, "code": self.code})
        return self.bench.work / "navigate" / f"{self.bench.name}_moved_{key}.jsonl"

    def picture(self, episode: str) -> Path:
        """Of an episode."""
        return self.results.with_suffix("") / f"{episode.replace('/', '_')}.png"

    def record_of(self, result: Result) -> Record | None:
        """None beyond the number of objects; see `RecordUnit`."""
        record = validated(result, Record, self.results)
        number = int(record.id.split("/")[1].removeprefix("moved_"))
        return record if number < self.tasks else None

    def seconds(self, done: frozenset[str]) -> float:
        """About how long it takes."""
        whole = MAP_S + RECORDING_S * self.bench.setup.frames + SEMANTICS_S
        left = max(0, self.tasks - len({one.rpartition("/")[0] for one in done}))
        return TASK_S * left + (0 if done else whole)

    def run(self, done: frozenset[str], add: Add, tell: Tell) -> None:
        """Goes to the objects that were not gone to yet.

        Raises:
            ValueError: The home gives no task, or no map can be made of it.
            OSError: The disk is full.
        """
        tasks = self.bench.tasks(TASKS_FOR_ONE * self.tasks)
        home = tasks[0].home.load(Path())
        known, cameras = taught(self.bench, tell), cameras_of_map(self.bench.map(tell))
        detector = ChangeDetector(known.gaussian_map, cameras=cameras.values())
        moved = [one for one in tasks if _is_only_one(one, home)][: self.tasks]
        for number, task in enumerate(moved):
            name = f"{self.bench.name}/moved_{number:02}"
            if f"{name}/0" in done:
                continue
            try:
                for record in self._walks(name, task, home, known, detector, [*cameras.values()]):
                    add(record.model_dump(mode="json"))
            except Exception as error:  # Whatever fails is told of its task; others go on.
                failed = record_of(self._episode(f"{name}/0", task))
                failed = failed.model_copy(update={"error": message_of(error)})
                add(failed.model_dump(mode="json"))
            tell(TASK_S)

    def _walks(
        self,
        name: str,
        task: Task,
        home: Home,
        known: TaughtMap,
        detector: ChangeDetector,
        cameras: list[Camera],
    ) -> Iterator[Record]:
        changed = _updated(task, home, known, detector, cameras)
        if changed is None:
            yield record_of(self._episode(f"{name}/0", task)).model_copy(
                update={"status": NOT_UPDATED}
            )
            return
        category, state = task.change.object_type, task.states(home)[1]
        truth = Truth(state.home)
        metres, starts = starts_to(truth, category)
        navigator = Navigator(changed, known.autoencoder, Oracle(), categories=[category])
        rng = np.random.default_rng([self.bench.seed, int(name[-2:])])
        self.results.with_suffix("").mkdir(parents=True, exist_ok=True)
        ground = Ground(state, truth, self.bench.setup.noise)
        for walk in range(WALKS if len(starts) else 0):
            place = int(rng.choice(starts))
            x, y = truth.places[place].tolist()
            episode = self._episode(
                f"{name}/{walk}",
                task,
                place=(x, y),
                yaw_deg=float(rng.integers(8) * 45),
                shortest_m=float(metres[place]),
            )
            yield gone(navigator, ground, episode, walk, self.picture(episode.name))

    def _episode(self, name: str, task: Task, **known: Any) -> Episode:
        start = {"place": (0.0, 0.0), "yaw_deg": 0.0, "shortest_m": 0.0, **known}
        return Episode(
            name=name, room_type=self.bench.room_type, category=task.change.object_type, **start
        )


def _is_only_one(task: Task, home: Home) -> bool:
    """Whether an object is relocated of whose type there is no other."""
    if task.change.kind != "relocation":
        return False
    after = task.states(home)[1].home
    return sum(thing.type == task.change.object_type for thing in after.objects) == 1


def _updated(
    task: Task, home: Home, known: TaughtMap, detector: ChangeDetector, cameras: list[Camera]
) -> GaussianMap | None:
    """The map after the relocation; None if it was not seen in the first frame, or rejected."""
    robot = task.start(home, changed=True)
    changes = detector.detect(robot.observe()).changes
    if not changes or not fits(report_of(changes[0]), task.change):
        return None
    result = update(
        known.gaussian_map,
        cameras,
        changes[:1],
        robot,
        UpdateConfig(threads=1),
        detector=detector,
        semantics=MapSemantics(Oracle(), known.autoencoder, ()),
    )
    return None if result.record.rejected is not None else result.gaussian_map
