"""Navigation to objects that were relocated after mapping, detected and updated in the map."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from gslts.change.detector import ChangeDetector
from gslts.core.camera import Camera
from gslts.core.gaussian_map import GaussianMap
from gslts.fleet.jobs import Add, message_of
from gslts.navigation.navigator import Navigator
from gslts.semantics.map_semantics import MapSemantics
from gslts.semantics.source import Oracle
from gslts.store.camera_files import cameras_of_map
from gslts.update.config import UpdateConfig
from gslts.update.integrate import integrate_changes
from gslts_bench.detection.run import Report
from gslts_bench.detection.score import fits
from gslts_bench.homes import BenchHome, even_shares
from gslts_bench.navigation.episodes import Episode, starts_to
from gslts_bench.navigation.run import Ground, NavigateUnit, Record, run_episode
from gslts_bench.navigation.truth import Truth
from gslts_bench.queries.semantic_map import SemanticMap, read_semantic_map
from gslts_bench.runner import BenchUnit
from gslts_sim.home import Home
from gslts_sim.task import Task

WALKS = 3
"""Number of episodes per object, from different positions."""
TASKS_PER_RELOCATION = 6
"""Number of tasks of a home that are made per relocation: a third of tasks are relocations."""
NOT_UPDATED = "not updated"
"""Status where the change was not detected in the first frame, or its update was rejected."""


@dataclass(frozen=True)
class RelocatedUnit(BenchUnit[Record, BenchHome]):
    """Work on one home, in which objects are relocated one at a time.

    Attributes:
        tasks: Number of relocations, of objects that are the only ones of their type.
    """

    topic = "navigate"
    record = Record

    tasks: int

    @property
    def name(self) -> str:
        """Name of the home with the kind of episode."""
        return f"{self.bench.name}_moved"

    @property
    def count(self) -> int:
        """Number of results when all is done, if all changes are detected."""
        return self.tasks * WALKS

    def is_asked(self, record: Record) -> bool:
        """Return whether this run asks for the object of a record.

        Args:
            record: A record in the file of results.
        """
        return int(record.id.split("/")[1].removeprefix("moved_")) < self.tasks

    def run(self, done: frozenset[str], add: Add) -> None:
        """Navigate to each relocated object that has no result yet.

        Args:
            done: Ids of the results of earlier runs.
            add: Receives each new result.
        """
        tasks = self.bench.tasks(TASKS_PER_RELOCATION * self.tasks)
        home = self.bench.load()
        known, cameras = read_semantic_map(self.bench), cameras_of_map(self.bench.map())
        detector = ChangeDetector.of_map(self.bench.map())
        relocations = [task for task in tasks if _is_unique_relocation(task, home)]
        for number, task in enumerate(relocations[: self.tasks]):
            name = f"{self.bench.name}/moved_{number:02}"
            if f"{name}/0" in done:
                continue
            try:
                walks = self._walks(name, task, home, known, detector, [*cameras.values()])
                records = list(walks)
            except Exception as error:  # Other objects go on.
                records = [self._record(f"{name}/0", task, error=message_of(error))]
            for record in reversed(records):  # The first one last: with it, the object is done.
                if record.id not in done:
                    add(record.model_dump(mode="json"))

    def _walks(
        self,
        name: str,
        task: Task,
        home: Home,
        known: SemanticMap,
        detector: ChangeDetector,
        cameras: list[Camera],
    ) -> Iterator[Record]:
        """Update the map with a relocation, and yield the episodes to the object."""
        changed = _update(task, home, known, detector, cameras)
        if changed is None:
            yield self._record(f"{name}/0", task, status=NOT_UPDATED)
            return
        category, state = task.change.object_type, task.states(home)[1]
        ground = Ground(state, Truth(state.home), self.bench.setup.noise)
        metres, starts = starts_to(ground.truth, category)
        navigator = Navigator(changed, known.codec, Oracle(), categories=[category])
        rng = np.random.default_rng([self.bench.seed, int(name[-2:])])
        for walk in range(WALKS if len(starts) else 0):
            start = int(rng.choice(starts))
            x, y = ground.truth.positions[start].tolist()
            episode = Episode(
                name=f"{name}/{walk}",
                room_type=self.bench.room_type,
                category=category,
                position=(x, y),
                yaw_deg=float(rng.integers(8) * 45),
                shortest_m=float(metres[start]),
            )
            found = run_episode(navigator, ground, episode, walk, self.image(episode.name))
            yield Record.of(episode).model_copy(update=found)

    def _record(self, name: str, task: Task, **result: Any) -> Record:
        """Make the record of a relocation without an episode."""
        category, room_type = task.change.object_type, self.bench.room_type
        return Record(id=name, room_type=room_type, category=category, shortest_m=0.0, **result)


def units_of(
    homes: Sequence[BenchHome], episodes: int, relocations: int
) -> list[BenchUnit[Record, BenchHome]]:
    """List the work of the benchmark.

    Args:
        homes: At least one.
        episodes: Number of episodes in all homes.
        relocations: Number of relocated objects in all homes.
    """
    shares = even_shares(episodes, len(homes)), even_shares(relocations, len(homes))
    units: list[BenchUnit[Record, BenchHome]] = []
    for home, count, tasks in zip(homes, *shares, strict=True):
        units += [NavigateUnit(home, count)] if count else []
        units += [RelocatedUnit(home, tasks)] if tasks else []
    return units


def _is_unique_relocation(task: Task, home: Home) -> bool:
    """Return whether an object is relocated that is the only one of its type."""
    if task.change.kind != "relocation":
        return False
    after = task.states(home)[1].home
    return sum(known.type == task.change.object_type for known in after.objects) == 1


def _update(
    task: Task, home: Home, known: SemanticMap, detector: ChangeDetector, cameras: list[Camera]
) -> GaussianMap | None:
    """Update the map with a relocation; None if it is not detected at once, or rejected."""
    robot = task.start(home, changed=True)
    changes = detector.detect(robot.observe()).changes
    if not changes or not fits(Report.of(changes[0]), task.change):
        return None
    result = integrate_changes(
        known.gaussian_map,
        cameras,
        changes[:1],
        robot,
        UpdateConfig(threads=1),
        detector=detector,
        semantics=MapSemantics(Oracle(), known.codec, ()),
    )
    return None if result.rejected is not None else result.gaussian_map
