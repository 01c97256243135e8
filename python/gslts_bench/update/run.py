"""Benchmark of updates in one home: changes are detected, and several methods update the map."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from pydantic import Field, FiniteFloat

from gslts.change.detector import ChangeDetector
from gslts.core.camera import Camera
from gslts.core.gaussian_map import GaussianMap
from gslts.fleet.jobs import Add, message_of
from gslts.io.image_files import write_image
from gslts.rendering.metrics import Lpips
from gslts.store.camera_files import cameras_of_map
from gslts.store.map_folder import read_map
from gslts.update.config import CollectConfig
from gslts.update.view_collection import Collection, collect_views
from gslts_bench.detection.cases import MIN_TASKS
from gslts_bench.detection.run import Report
from gslts_bench.detection.score import fits
from gslts_bench.homes import BenchHome, even_shares
from gslts_bench.runner import BenchRecord, BenchUnit
from gslts_bench.update.comparison import compare
from gslts_bench.update.methods import ABLATION, METHODS, Method, update_with
from gslts_bench.update.score import EvaluationView, Judge, evaluation_view
from gslts_sim.controller import Controller
from gslts_sim.home import Home
from gslts_sim.task import Task

MARKS = (0, 50, 100, 250, 500, 1000)
"""Iterations after which maps are compared in the curve."""
CURVE_OF = ("plain fine-tuning", "ours")
"""Methods that have a curve."""
NOT_DETECTED = "not detected"
"""Method of the record of a change that was not detected."""


class Record(BenchRecord):
    """Result of one method on one task.

    Attributes:
        task: Home and number, such as `kitchen_0/07`.
        kind, object_type: Type of the change and of its object.
        method: One of `METHODS` or `ABLATION`, `NOT_DETECTED`, or `curve, ` and the method.
        detected: Whether type and region of the most confident change were right in the first
            frame; otherwise there is no update.
        views: Number of frames that were collected.
        scores: Scores of near and far test viewpoints; see `update.score.Score`.
        rejected: Reason if the map stays as it was.
        gaussians: Number before and after.
        removed, added, iterations: see `gslts.store.causes.UpdateRecord`.
        seconds: Time by stage; the whole under `update`.
        curve: PSNR of near and far viewpoints, dB, by number of iterations; after 50 iterations of
            a run of 250 under `50 of 250`.
    """

    task: str
    kind: str
    object_type: str
    method: str
    detected: bool = False
    views: int = 0
    scores: dict[str, dict[str, FiniteFloat | None]] = Field(default_factory=dict)
    rejected: str | None = None
    gaussians: tuple[int, int] = (0, 0)
    removed: int = 0
    added: int = 0
    iterations: int = 0
    seconds: dict[str, FiniteFloat] = Field(default_factory=dict)
    curve: dict[str, tuple[FiniteFloat, FiniteFloat]] = Field(default_factory=dict)


@dataclass(frozen=True)
class UpdateUnit(BenchUnit[Record, BenchHome]):
    """Work on one home.

    Attributes:
        tasks: Number of tasks.
        views: Number of views around a changed region.
        ablation: Whether the methods of `ABLATION` are measured too.
        curves: Number of tasks with curves.
        lpips: Files of the weights of LPIPS, backbone and heads; None leaves it out.
        threads: Threads of an update; only the seconds depend on them.
    """

    topic = "update"
    record = Record

    tasks: int
    views: int
    ablation: bool = False
    curves: int = 0
    lpips: tuple[Path, Path] | None = None
    threads: int = 1

    @property
    def count(self) -> int:
        """Number of results when all is done."""
        return self.tasks * len(self.methods) + self.curves * len(CURVE_OF)

    @property
    def settings(self) -> dict[str, Any]:
        """Values that decide the results besides map and code."""
        weights = None if self.lpips is None else [str(path) for path in self.lpips]
        return {"lpips": weights, "threads": self.threads, "views": self.views}

    @cached_property
    def methods(self) -> dict[str, Method]:
        """Methods that are compared, by name."""
        return {**METHODS, **(ABLATION if self.ablation else {})}

    def is_asked(self, record: Record) -> bool:
        """Return whether this run asks for the task and the method of a record.

        Args:
            record: A record in the file of results.
        """
        is_method = self.ablation or record.method not in ABLATION
        return is_method and int(record.task.rpartition("/")[2]) < self.tasks

    def count_missing(self, records: Sequence[Record]) -> int:
        """Return how many of the tasks that were asked for do not exist.

        Args:
            records: Records that are asked for, with errors.
        """
        return self.tasks - len({record.task for record in records})

    def run(self, done: frozenset[str], add: Add) -> None:
        """Update the map for each task with each method that has no result yet.

        Args:
            done: Ids of the results of earlier runs.
            add: Receives each new result.
        """
        tasks = self.bench.tasks(max(MIN_TASKS, self.tasks))[: self.tasks]
        ground = _Ground.of(self.bench.map(), self.bench.load(), self.lpips)
        for number, task in enumerate(tasks):
            name = f"{self.name}/{number:02}"
            if f"{name}: {NOT_DETECTED}" in done:
                continue
            methods = [method for method in self.methods if f"{name}: {method}" not in done]
            curves = [
                method
                for method in CURVE_OF
                if number < self.curves and f"{name}: curve, {method}" not in done
            ]
            try:
                if methods or curves:
                    self._compare(name, task, ground, methods, curves, add)
            except Exception as error:  # Other tasks go on.
                failed = _record(name, task, "failed", error=message_of(error))
                add(failed.model_dump(mode="json"))

    def _compare(
        self,
        name: str,
        task: Task,
        ground: _Ground,
        methods: Sequence[str],
        curves: Sequence[str],
        add: Add,
    ) -> None:
        """Detect a change, collect frames of it, and update the map with each method."""
        robot = task.start(ground.home, changed=True)
        detection = ground.detector.detect(robot.observe())
        change = detection.changes[0] if detection.changes else None
        if change is None or not fits(Report.of(change), task.change):
            add(_record(name, task, NOT_DETECTED).model_dump(mode="json"))
            return
        start_s = time.perf_counter()
        collect = CollectConfig(steps=self.views - 1)
        found = collect_views(robot, ground.detector, [change], collect, threads=self.threads)
        collecting_s = time.perf_counter() - start_s
        judge = Judge(ground.evaluation_views(task), ground.lpips)
        maps: dict[str, GaussianMap] = {}
        records = []
        for method in methods:
            maps[method], numbers = self._update(method, ground, found, collecting_s)
            scores = {view: asdict(score) for view, score in judge.scores(maps[method]).items()}
            records.append(_record(name, task, method, scores=scores, **numbers))
        if all(method in maps for method in METHODS):
            path = self.image(name)
            path.parent.mkdir(parents=True, exist_ok=True)
            write_image(path, compare(judge, {method: maps[method] for method in METHODS}))
        for record in records:  # Together: what has a result has its image, too.
            add(record.model_dump(mode="json"))
        for method in curves:
            curve = _curve(METHODS[method], ground, found, judge)
            record = _record(name, task, f"curve, {method}", detected=True, curve=curve)
            add(record.model_dump(mode="json"))

    def _update(
        self, name: str, ground: _Ground, found: Collection, collecting_s: float
    ) -> tuple[GaussianMap, dict[str, Any]]:
        """Update the map with a method; return it with numbers for the record."""
        start_s = time.perf_counter()
        updated, record = update_with(
            self.methods[name], ground.gaussian_map, ground.cameras, found, threads=self.threads
        )
        seconds = {"update": time.perf_counter() - start_s, "collecting": collecting_s}
        numbers: dict[str, Any] = {
            "detected": True,
            "views": len(found.views),
            "gaussians": (ground.gaussian_map.size, updated.size),
            "seconds": seconds,
        }
        if record is not None:
            seconds |= record.seconds
            numbers |= {
                "rejected": record.rejected,
                "removed": record.removed,
                "added": record.added,
                "iterations": record.iterations,
            }
        return updated, numbers


def units_of(
    homes: Sequence[BenchHome],
    tasks: int,
    *,
    views: int,
    ablation: bool,
    curves: int,
    lpips: tuple[Path, Path] | None,
    threads: int,
) -> list[UpdateUnit]:
    """List the work of the benchmark.

    Args:
        homes: At least one.
        tasks: Number of tasks in all homes.
        views: Number of views around a changed region, at least 3.
        ablation: Whether the methods of `ABLATION` are measured too.
        curves: Number of tasks with curves in all homes.
        lpips: Files of the weights of LPIPS, backbone and heads; None leaves it out.
        threads: Threads of an update.
    """
    shares = zip(
        homes, even_shares(tasks, len(homes)), even_shares(curves, len(homes)), strict=True
    )
    return [
        UpdateUnit(home, own, views, ablation, drawn, lpips, threads) for home, own, drawn in shares
    ]


@dataclass(frozen=True, eq=False)
class _Ground:
    """State that all tasks of a home have in common."""

    home: Home
    gaussian_map: GaussianMap
    cameras: list[Camera]
    detector: ChangeDetector
    lpips: Lpips | None

    @classmethod
    def of(cls, folder: Path, home: Home, lpips: tuple[Path, Path] | None) -> _Ground:
        gaussian_map = read_map(folder)
        cameras = list(cameras_of_map(folder).values())
        detector = ChangeDetector.of_map(folder)
        return cls(home, gaussian_map, cameras, detector, None if lpips is None else Lpips(*lpips))

    def evaluation_views(self, task: Task) -> list[EvaluationView]:
        """Return the test viewpoints of a task, with images without noise."""
        robot = Controller(
            task.states(self.home)[1],
            width=task.sensor.width,
            height=task.sensor.height,
            noise="none",
        )
        views = []
        sets = task.test_viewpoints
        for number, viewpoint in enumerate((*sets.near, *sets.far)):
            robot.go(viewpoint)
            frame = robot.snapshot(number).observation
            near = number < len(sets.near)
            view = evaluation_view(frame, task.change, self.gaussian_map, near=near)
            views += [] if view is None else [view]
        return views


def _curve(
    method: Method, ground: _Ground, found: Collection, judge: Judge
) -> dict[str, tuple[float, float]]:
    """Return the PSNR of near and far viewpoints by number of iterations."""
    points: dict[str, tuple[float, float]] = {}

    def note(name: str, gaussian_map: GaussianMap) -> None:
        psnrs_db = judge.psnrs_db(gaussian_map)
        points[name] = (psnrs_db["near"], psnrs_db["far"])

    def run(iterations: int, marks: Sequence[int] = (), suffix: str = "") -> GaussianMap:
        def on_step(step: int, current: Any) -> None:
            if step in marks:
                note(f"{step}{suffix}", current())

        result, _ = update_with(
            method,
            ground.gaussian_map,
            ground.cameras,
            found,
            iterations=iterations,
            on_step=on_step,
        )
        return result

    if not method.whole:  # Its rates stay the same: one run goes through all marks.
        note("0", ground.gaussian_map)
        run(MARKS[-1], MARKS)
        return points
    for mark in MARKS:
        note(str(mark), run(mark))
    run(250, (50,), " of 250")
    return points


def _record(name: str, task: Task, method: str, **numbers: Any) -> Record:
    return Record(
        id=f"{name}: {method}",
        task=name,
        kind=task.change.kind,
        object_type=task.change.object_type,
        method=method,
        **numbers,
    )
