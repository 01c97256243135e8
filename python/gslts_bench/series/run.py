"""Benchmark of many changes in a row, each updated in the map; at the end a map is rebuilt."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import compress
from typing import Any

import numpy as np
from pydantic import BaseModel, FiniteFloat

from gslts.change.detector import ChangeDetector
from gslts.consolidation.consolidate import consolidate
from gslts.core.camera import Camera, new_viewpoints
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.core.robot import Robot
from gslts.fleet.jobs import Add
from gslts.rendering.losses import apply_exposure
from gslts.rendering.metrics import psnr_db
from gslts.store.camera_files import cameras_of_map
from gslts.store.delta import apply_deltas
from gslts.store.map_folder import read_map
from gslts.store.records import NO_UPDATES, Updates
from gslts.update.config import UpdateConfig
from gslts.update.integrate import integrate_changes
from gslts.update.region import Region, regions_of
from gslts_bench.detection.run import Report
from gslts_bench.detection.score import fits
from gslts_bench.detection.visits import draw_visit
from gslts_bench.homes import BenchHome
from gslts_bench.runner import BenchRecord, BenchUnit
from gslts_bench.update.score import align_with_map
from gslts_sim.actions import SceneState
from gslts_sim.controller import Controller
from gslts_sim.strict_model import STRICT
from gslts_sim.task import Kind, SensorSetup, Task
from gslts_sim.tasks import TaskMaker

NEW_VIEWS = 40
"""Number of viewpoints that judge a map, drawn anew for each state."""
MAPS = UPDATED, BEFORE, REBUILT = ("updated", "before all changes", "rebuilt")
"""Maps that are compared at the end."""


class Step(BaseModel):
    """Result of one change.

    Attributes:
        kind, object_type: Type of the change and of its object.
        detected: Whether it was among the changes detected in the first frame.
        changes: Number of detected changes; all of them are updated.
        rejected: Reason if the map stays as it was.
        gaussians: Number of Gaussians of the map after it.
        seconds: Time of edit and refinement.
        psnr_db: PSNR of the map after it at new viewpoints; None where it was not measured.
    """

    model_config = STRICT

    kind: Kind
    object_type: str
    detected: bool
    changes: int
    rejected: str | None
    gaussians: int
    seconds: FiniteFloat
    psnr_db: FiniteFloat | None


class End(BaseModel):
    """Comparison of maps after all changes.

    Attributes:
        psnr_db: PSNR of each of `MAPS` at new viewpoints.
        gaussians: Number of Gaussians of the same.
    """

    model_config = STRICT

    psnr_db: dict[str, FiniteFloat]
    gaussians: dict[str, int]


class Record(BenchRecord):
    """Result of one change, or of the end of a home; the id is the home and a number or `end`."""

    step: Step | None = None
    end: End | None = None


@dataclass(frozen=True)
class SeriesUnit(BenchUnit[Record, BenchHome]):
    """Work on one home.

    Attributes:
        changes: Number of changes in a row.
        every: PSNR is measured after so many changes.
        consolidate: The map is consolidated after so many changes; 0 for never.
    """

    topic = "series"
    record = Record

    changes: int
    every: int
    consolidate: int = 0

    @property
    def results(self) -> None:
        """No file: a change goes on from the map after the one before."""
        return

    @property
    def count(self) -> int:
        """Number of results when all is done."""
        return self.changes + 1

    def run(self, done: frozenset[str], add: Add) -> None:  # noqa: ARG002
        """Apply the changes of the series one after another.

        Args:
            done: Ids of the results of earlier runs.
            add: Receives each new result.
        """
        folder = self.bench.map()
        first = read_map(folder)
        updated = first
        cameras = list(cameras_of_map(folder).values())
        detector = ChangeDetector.of_map(folder)
        tasks = self._tasks()
        home = self.bench.load()
        regions: list[Region] = []
        last = NO_UPDATES  # The detector knows the earlier ones.
        for number, task in enumerate(tasks, start=1):
            robot = task.start(home, changed=True)
            detector = detector.with_map(updated, cameras, last)
            found = detector.detect(robot.observe()).changes
            next_id = int(updated.ids.max()) + 1
            result = integrate_changes(
                updated, cameras, found, robot, UpdateConfig(threads=1), detector=detector
            )
            seconds = result.record.seconds
            updated = result.gaussian_map
            if result.rejected is None:  # As `gslts update` does.
                seen_from = [view.camera for view in result.views]
                cameras += compress(seen_from, new_viewpoints(cameras, seen_from))
            regions += [region for change in result.changes for region in regions_of(change)]
            last = Updates.of_boxes(
                (change.boxes for change in result.changes),
                [range(next_id, int(updated.ids.max()) + 1)],
            )
            if regions and self.consolidate and number % self.consolidate == 0:
                updated = _consolidate(updated, cameras, regions, robot)
                regions = []
            frames = []
            if number % self.every == 0 or number == len(tasks):
                frames = new_frames(task.states(home)[1], task.sensor, number)
            step = Step(
                kind=task.change.kind,
                object_type=task.change.object_type,
                detected=any(fits(Report.of(change), task.change) for change in found),
                changes=len(found),
                rejected=result.rejected if found else None,
                gaussians=updated.size,
                seconds=seconds.get("editing", 0.0) + seconds.get("refining", 0.0),
                psnr_db=mean_psnr_db(updated, frames) if frames else None,
            )
            add(Record(id=f"{self.name}/{number:03}", step=step).model_dump(mode="json"))
        rebuilt = read_map(_EndHome(**vars(self.bench), last=tasks[-1]).map())
        maps = dict(zip(MAPS, (updated, first, rebuilt), strict=True))
        frames = new_frames(tasks[-1].states(home)[1], tasks[-1].sensor, 0)
        end = End(
            psnr_db={name: mean_psnr_db(known, frames) for name, known in maps.items()},
            gaussians={name: known.size for name, known in maps.items()},
        )
        add(Record(id=f"{self.name}/end", end=end).model_dump(mode="json"))

    def _tasks(self) -> list[Task]:
        """Return the changes, the first of which starts from the state of the map."""
        start = self.bench.tasks(1)[0]
        source, home = start.home, self.bench.load()
        maker = TaskMaker(self.bench.setup.setting, self.bench.seed)
        tasks = list(maker.make_sequence(source, home, self.changes))
        if len(tasks) < self.changes:
            raise ValueError(f"{self.name}: {len(tasks)} of {self.changes} changes are possible")
        return tasks


def _consolidate(
    gaussian_map: GaussianMap, cameras: Sequence[Camera], regions: Sequence[Region], robot: Robot
) -> GaussianMap:
    """Return the map after a consolidation; the same map if that was rejected."""
    delta = consolidate(gaussian_map, cameras, regions, robot, threads=1).delta
    return gaussian_map if delta is None else apply_deltas(gaussian_map, [delta])


def new_frames(
    state: SceneState, sensor: SensorSetup, seed: int, count: int = NEW_VIEWS
) -> list[RgbdFrame]:
    """Take noise-free frames from random viewpoints in a home.

    Args:
        state: State of the home.
        sensor: Sensor, for the size of its images.
        seed: Seed of the viewpoints.
        count: Number of frames.
    """
    robot = Controller(state, width=sensor.width, height=sensor.height, noise="none")
    rng = np.random.default_rng([seed, 2])
    frames = []
    for number in range(count):
        robot.go(draw_visit(robot.home, rng).viewpoint)
        frames.append(robot.snapshot(number).observation)
    return frames


def mean_psnr_db(gaussian_map: GaussianMap, frames: Sequence[RgbdFrame]) -> float:
    """Average the PSNR of frames, with cameras aligned with the map and fitted exposures, dB.

    Args:
        gaussian_map: The map, float32.
        frames: Noise-free frames with nearly right poses.
    """
    psnrs_db = []
    for frame in frames:
        _, exposure, rgb = align_with_map(frame, gaussian_map)
        photo = frame.rgb.astype(np.float32) / np.float32(255)
        rendered = apply_exposure(rgb, exposure).clip(0, 1)
        psnrs_db.append(psnr_db(np.asarray(rendered, np.float32), photo))
    return float(np.mean(psnrs_db))


@dataclass(frozen=True, kw_only=True)
class _EndHome(BenchHome):
    """A home after the last of its changes."""

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
