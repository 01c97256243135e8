"""Many changes in a row, each brought into the map; at the end another map is built anew."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import compress
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, FiniteFloat

from gslts.change.detector import ChangeDetector
from gslts.core.camera import new_viewpoints
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.rendering.losses import apply_exposure
from gslts.rendering.metrics import psnr_db
from gslts.store.camera_files import cameras_of_map
from gslts.store.map_folder import read_map
from gslts.update.config import UpdateConfig
from gslts.update.updater import update
from gslts_bench.detection.run import report_of
from gslts_bench.detection.score import fits
from gslts_bench.detection.visits import draw_visit
from gslts_bench.homes import MAP_S, RECORDING_S, BenchHome
from gslts_bench.update.score import as_mapped
from gslts_bench.work import Add, Tell, run_units
from gslts_sim.actions import SceneState
from gslts_sim.change_sampler import TaskSettings
from gslts_sim.controller import Controller
from gslts_sim.strict_model import STRICT
from gslts_sim.task import Kind, SensorSetup, Task
from gslts_sim.tasks import TaskMaker

FRESH_VIEWS = 40
"""That nothing was mapped from, drawn anew for each state that is looked at."""
MAPS = UPDATED, BEFORE, ANEW = ("updated", "before all changes", "built anew")
STEP_S, LOOK_S = 12.0, 20.0
"""About how long a change takes, and a comparison, for the progress."""


class Step(BaseModel):
    """One change, and what became of the map.

    Attributes:
        id: The home, and the number of the change.
        kind, object_type: Of the change.
        detected: Whether it was among the changes detected in the first frame.
        changes: How many those were; all of them are updated.
        rejected: Why the map stays as it was.
        gaussians: Of the map after it.
        seconds: Of edit and refinement.
        psnr_db: Of the map after it, of fresh views; None where it was not looked at.
    """

    model_config = STRICT

    id: str
    kind: Kind
    object_type: str
    detected: bool
    changes: int
    rejected: str | None
    gaussians: int
    seconds: FiniteFloat
    psnr_db: FiniteFloat | None


class End(BaseModel):
    """The state after all changes, from fresh views.

    Attributes:
        id: The home.
        psnr_db: Of each of `MAPS`.
        gaussians: Of the same.
    """

    model_config = STRICT

    id: str
    psnr_db: dict[str, FiniteFloat]
    gaussians: dict[str, int]


@dataclass(frozen=True)
class SeriesUnit:
    """One home.

    Attributes:
        bench: The home.
        changes: How many in a row.
        every: After so many the map is compared with what can be seen.
    """

    bench: BenchHome
    changes: int
    every: int

    @property
    def name(self) -> str:
        """That of the home."""
        return self.bench.name

    @property
    def results(self) -> None:
        """None are kept: a change goes on from the map after the one before."""
        return None

    def seconds(self, done: frozenset[str]) -> float:  # noqa: ARG002
        """About how long it takes."""
        maps = 2 * (MAP_S + RECORDING_S * self.bench.setup.frames)
        return maps + self.changes * STEP_S + self.changes / self.every * LOOK_S

    def run(self, done: frozenset[str], add: Add, tell: Tell) -> None:  # noqa: ARG002
        """Lets one change after another happen.

        Raises:
            ValueError: The home gives no change, or no map can be made of it.
            OSError: The disk is full.
        """
        folder = self.bench.map(tell)
        first = read_map(folder)
        updated = first
        cameras = list(cameras_of_map(folder).values())
        tasks = self._tasks()
        home = tasks[0].home.load(Path())
        for number, task in enumerate(tasks, start=1):
            robot = task.start(home, changed=True)
            detector = ChangeDetector(updated, cameras=cameras)
            found = detector.detect(robot.observe()).changes
            start_s = time.perf_counter()
            result = update(
                updated, cameras, found, robot, UpdateConfig(threads=1), detector=detector
            )
            seconds = result.record.seconds
            updated = result.gaussian_map
            if result.record.rejected is None:  # As `gslts update` does.
                seen_from = [view.camera for view in result.views]
                cameras += compress(seen_from, new_viewpoints(cameras, seen_from))
            look = number % self.every == 0 or number == len(tasks)
            frames = fresh_frames(task.states(home)[1], task.sensor, number) if look else []
            step = Step(
                id=f"{self.name}/{number:03}",
                kind=task.change.kind,
                object_type=task.change.object_type,
                detected=any(fits(report_of(change), task.change) for change in found),
                changes=len(found),
                rejected=result.record.rejected if found else None,
                gaussians=updated.size,
                seconds=seconds.get("editing", 0.0) + seconds.get("refining", 0.0),
                psnr_db=psnr_of(updated, frames) if look else None,
            )
            add(step.model_dump(mode="json"))
            tell(time.perf_counter() - start_s)
        anew = read_map(_EndHome(**vars(self.bench), last=tasks[-1]).map(tell))
        maps = dict(zip(MAPS, (updated, first, anew), strict=True))
        frames = fresh_frames(tasks[-1].states(home)[1], tasks[-1].sensor, 0)
        end = End(
            id=f"{self.name}/end",
            psnr_db={name: psnr_of(one, frames) for name, one in maps.items()},
            gaussians={name: one.size for name, one in maps.items()},
        )
        add(end.model_dump(mode="json"))

    def _tasks(self) -> list[Task]:
        """The changes, the first of which starts from what the map shows."""
        setup = self.bench.setup
        setting = TaskSettings(noise=setup.noise, width=setup.width, height=setup.height)
        start = self.bench.tasks(1)[0]
        source, home = start.home, start.home.load(Path())
        maker = TaskMaker(setting, self.bench.seed)
        tasks = list(maker.make_sequence(source, home, self.changes))
        if len(tasks) < self.changes:
            raise ValueError(f"{self.name}: {len(tasks)} of {self.changes} changes are possible")
        return tasks


def fresh_frames(
    state: SceneState, sensor: SensorSetup, seed: int, count: int = FRESH_VIEWS
) -> list[RgbdFrame]:
    """Clean frames from anywhere in a home."""
    robot = Controller(state, width=sensor.width, height=sensor.height, noise="none")
    rng = np.random.default_rng([seed, 2])
    frames = []
    for number in range(count):
        robot.go(draw_visit(robot.home, rng).look)
        frames.append(robot.snapshot(number).observation)
    return frames


def psnr_of(gaussian_map: GaussianMap, frames: Sequence[RgbdFrame]) -> float:
    """Mean over frames, dB, with cameras aligned with the map and an exposure fitted to it."""
    psnrs_db = []
    for frame in frames:
        _, exposure, rgb = as_mapped(frame, gaussian_map)
        photo = frame.rgb.astype(np.float32) / np.float32(255)
        shown = apply_exposure(rgb, exposure).clip(0, 1)
        psnrs_db.append(psnr_db(np.asarray(shown, np.float32), photo))
    return float(np.mean(psnrs_db))


@dataclass(frozen=True, kw_only=True)
class _EndHome(BenchHome):
    """A home as a series of changes left it."""

    last: Task

    @property
    def name(self) -> str:
        return f"{super().name}_end"

    @property
    def recorded_of(self) -> dict[str, Any]:
        return {**super().recorded_of, "last": self.last.model_dump(mode="json")}

    def tasks(self, count: int) -> list[Task]:  # noqa: ARG002
        done = (*self.last.initial_actions, *self.last.change_actions)
        return [self.last.model_copy(update={"initial_actions": done})]


def measure(
    units: Sequence[SeriesUnit], jobs: int, bar: Any
) -> tuple[dict[str, list[Step]], dict[str, End], dict[str, str]]:
    """Does the work: the steps and the end of each home, and errors of those that failed."""
    steps: dict[str, list[Step]] = {}
    ends: dict[str, End] = {}
    failed: dict[str, str] = {}
    for name, results in run_units(units, jobs, bar).items():
        for result in results:
            if result["id"] == name:
                failed[name] = result["error"]
            elif result["id"].endswith("/end"):
                ends[name] = End.model_validate_json(json.dumps(result))
            else:
                step = Step.model_validate_json(json.dumps(result))
                steps.setdefault(name, []).append(step)
    return steps, ends, failed
