"""Updates in one home: tasks are detected, looked at and brought into the map in several ways."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from PIL import Image
from pydantic import BaseModel, FiniteFloat

from gslts.change.detector import ChangeDetector
from gslts.core.camera import Camera
from gslts.core.gaussian_map import GaussianMap
from gslts.rendering.metrics import Lpips
from gslts.store.camera_files import cameras_of_map
from gslts.store.map_folder import read_map
from gslts.update.config import CollectConfig
from gslts.update.view_collection import Collection, collect
from gslts_bench.cache import code_digest, digest, native_digest
from gslts_bench.detection.run import report_of
from gslts_bench.detection.score import fits
from gslts_bench.homes import MAP_S, RECORDING_S, BenchHome
from gslts_bench.update.methods import ABLATION, METHODS, Method, updated
from gslts_bench.update.pictures import compared
from gslts_bench.update.score import Judge, JudgedView, judged_view
from gslts_bench.work import Add, Result, Tell, message_of, validated
from gslts_sim.controller import Controller
from gslts_sim.home import Home
from gslts_sim.strict_model import STRICT
from gslts_sim.task import Task

MARKS = (0, 50, 100, 250, 500, 1000)
"""Iterations after which maps are compared in the curve."""
CURVE_OF = ("plain fine-tuning", "ours")
LEAST_TASKS = 12
TASK_S, METHOD_S, CURVE_S = 15.0, 10.0, 120.0
"""About how long it takes, for the progress."""


class Record(BaseModel):
    """What a method made of one task.

    Attributes:
        id: Of task and method.
        task: Its home and its number, such as `kitchen_0/07`.
        kind: Of the change.
        object_type: Of what changed.
        method: Of `METHODS` or `ABLATION`, `not detected`, or `curve, ` and the method.
        detected: Whether type and region of the most certain change were right in the first frame;
            if not, there is no update.
        views: That were collected.
        scores: Of the near and of the far test views; see `update_score.Score`.
        rejected: Why the map stays as it was.
        gaussians: Before and after.
        removed, added, iterations: See `gslts.update.updater.Record`.
        seconds: By stage; all of it under `update`.
        curve: PSNR of near and far views, dB, after so many iterations; and of a run of 250 after
            50 of them under `50 of 250`.
        error: Why there is no result.
    """

    model_config = STRICT

    id: str
    task: str
    kind: str
    object_type: str
    method: str
    detected: bool = False
    views: int = 0
    scores: dict[str, dict[str, FiniteFloat | None]] = {}
    rejected: str | None = None
    gaussians: tuple[int, int] = (0, 0)
    removed: int = 0
    added: int = 0
    iterations: int = 0
    seconds: dict[str, FiniteFloat] = {}
    curve: dict[str, tuple[FiniteFloat, FiniteFloat]] = {}
    error: str | None = None


@dataclass(frozen=True)
class UpdateUnit:
    """One home.

    Attributes:
        bench: The home.
        tasks: How many.
        ablation: Whether the methods of `ABLATION` are tried too.
        curves: Of how many tasks curves are made.
        lpips: Files of the weights of LPIPS, backbone and heads; None leaves it out.
        threads: Of an update; results are the same but for seconds.
        code: Digests of the code that updates; see `HomeSetup`.
    """

    bench: BenchHome
    tasks: int
    ablation: bool = False
    curves: int = 0
    lpips: tuple[Path, Path] | None = None
    threads: int = 1
    code: dict[str, Any] = field(
        default_factory=lambda: {"python": code_digest(__name__), "native": native_digest()}
    )

    @property
    def name(self) -> str:
        """That of the home."""
        return self.bench.name

    @cached_property
    def results(self) -> Path:
        """The file of records; another one when anything that decides them is another."""
        weights = None if self.lpips is None else [str(path) for path in self.lpips]
        key = digest(
            {
                "map": self.bench.mapped_of,
                "code": self.code,
                "lpips": weights,
                "threads": self.threads,
            }
        )
        return self.bench.work / "update" / f"{self.name}_{key}.jsonl"

    @property
    def methods(self) -> dict[str, Method]:
        """Those that are compared."""
        return {**METHODS, **(ABLATION if self.ablation else {})}

    def record_of(self, result: Result) -> Record | None:
        """None beyond the number of tasks; see `RecordUnit`."""
        record = validated(result, Record, self.results)
        return record if int(record.task.rpartition("/")[2]) < self.tasks else None

    def picture(self, task: str) -> Path:
        """Of a task."""
        return self.results.with_suffix("") / f"{task.replace('/', '_')}.png"

    def seconds(self, done: frozenset[str]) -> float:
        """About how long it takes."""
        wanted = self.tasks * len(self.methods)
        left = max(0, wanted - len(done)) / max(1, wanted)
        whole = MAP_S + RECORDING_S * self.bench.setup.frames
        work = self.tasks * (TASK_S + METHOD_S * len(self.methods)) + CURVE_S * self.curves
        return left * work + (0 if done else whole)

    def run(self, done: frozenset[str], add: Add, tell: Tell) -> None:
        """Updates the map with each task, in each way that was not tried yet.

        Raises:
            ValueError: The home gives no task, or no map can be made of it.
            OSError: The disk is full.
        """
        tasks = self.bench.tasks(max(LEAST_TASKS, self.tasks))[: self.tasks]
        ground = _Ground.of(self.bench.map(tell), tasks[0].home.load(Path()), self.lpips)
        for number, task in enumerate(tasks):
            name = f"{self.name}/{number:02}"
            if f"{name}: not detected" in done:
                continue
            methods = {
                one: way for one, way in self.methods.items() if f"{name}: {one}" not in done
            }
            curves = [
                one
                for one in CURVE_OF
                if number < self.curves and f"{name}: curve, {one}" not in done
            ]
            if methods or curves:
                try:
                    self._try(name, task, ground, methods, curves, add)
                except Exception as error:  # Whatever fails is told of its task; others go on.
                    failed = _record(name, task, "failed").model_copy(
                        update={"error": message_of(error)}
                    )
                    add(failed.model_dump(mode="json"))
            tell(TASK_S + METHOD_S * len(methods) + CURVE_S * bool(curves))

    def _try(
        self,
        name: str,
        task: Task,
        ground: _Ground,
        methods: dict[str, Method],
        curves: Sequence[str],
        add: Add,
    ) -> None:
        robot = task.start(ground.home, changed=True)
        detection = ground.detector.detect(robot.observe())
        change = detection.changes[0] if detection.changes else None
        if change is None or not fits(report_of(change), task.change):
            add(_record(name, task, "not detected").model_dump(mode="json"))
            return
        start_s = time.perf_counter()
        found = collect(robot, ground.detector, [change], CollectConfig(), threads=self.threads)
        collecting_s = time.perf_counter() - start_s
        judge = Judge(ground.judged(task), ground.lpips)
        maps: dict[str, GaussianMap] = {}
        for one, method in methods.items():
            start_s = time.perf_counter()
            maps[one], told = updated(
                method, ground.gaussian_map, ground.cameras, found, threads=self.threads
            )
            seconds = {"update": time.perf_counter() - start_s, "collecting": collecting_s}
            known: dict[str, Any] = {}
            if told is not None:
                seconds |= told.seconds
                known = {
                    "rejected": told.rejected,
                    "removed": told.removed,
                    "added": told.added,
                    "iterations": told.iterations,
                }
            scores = {view: asdict(score) for view, score in judge.scores(maps[one]).items()}
            record = _record(name, task, one).model_copy(
                update={
                    **known,
                    "detected": True,
                    "views": len(found.views),
                    "scores": scores,
                    "gaussians": (ground.gaussian_map.size, maps[one].size),
                    "seconds": seconds,
                }
            )
            add(record.model_dump(mode="json"))
        if all(one in maps for one in METHODS):
            path = self.picture(name)
            path.parent.mkdir(parents=True, exist_ok=True)
            Image.fromarray(compared(judge, {one: maps[one] for one in METHODS})).save(path)
        for one in curves:
            record = _record(name, task, f"curve, {one}").model_copy(
                update={"detected": True, "curve": _curve(METHODS[one], ground, found, judge)}
            )
            add(record.model_dump(mode="json"))


@dataclass(frozen=True, eq=False)
class _Ground:
    """What all tasks of a home have in common."""

    home: Home
    gaussian_map: GaussianMap
    cameras: list[Camera]
    detector: ChangeDetector
    lpips: Lpips | None

    @classmethod
    def of(cls, folder: Path, home: Home, lpips: tuple[Path, Path] | None) -> _Ground:
        gaussian_map = read_map(folder)
        cameras = list(cameras_of_map(folder).values())
        detector = ChangeDetector(gaussian_map, cameras=cameras)
        return cls(home, gaussian_map, cameras, detector, None if lpips is None else Lpips(*lpips))

    def judged(self, task: Task) -> list[JudgedView]:
        """The test views of a task, without noise."""
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
            view = judged_view(frame, task.change, self.gaussian_map, near=near)
            views += [] if view is None else [view]
        return views


def _curve(
    method: Method, ground: _Ground, found: Collection, judge: Judge
) -> dict[str, tuple[float, float]]:
    """PSNR of near and far views after some iterations."""
    points: dict[str, tuple[float, float]] = {}

    def note(name: str, gaussian_map: GaussianMap) -> None:
        of = judge.psnrs_db(gaussian_map)
        points[name] = (of["near"], of["far"])

    def run(iterations: int, marks: Sequence[int] = (), suffix: str = "") -> GaussianMap:
        def watch(step: int, current: Any) -> None:
            if step in marks:
                note(f"{step}{suffix}", current())

        result, _ = updated(
            method,
            ground.gaussian_map,
            ground.cameras,
            found,
            iterations=iterations,
            watch=watch,
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


def _record(name: str, task: Task, method: str) -> Record:
    return Record(
        id=f"{name}: {method}",
        task=name,
        kind=task.change.kind,
        object_type=task.change.object_type,
        method=method,
    )
