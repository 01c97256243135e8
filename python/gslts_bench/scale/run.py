"""Benchmark of scale in one home: maps of more and more copies of it."""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from pydantic import Field, FiniteFloat

from gslts.change.config import DetectionConfig
from gslts.change.detector import ChangeDetector
from gslts.fleet.jobs import Add
from gslts.localization.config import RelocalizationConfig
from gslts.localization.landmark_files import read_landmarks, write_landmarks
from gslts.localization.relocalizer import Relocalizer
from gslts.semantics.autoencoder import autoencoder_bytes
from gslts.store.camera_files import cameras_of_map
from gslts.store.map_folder import write_map_folder
from gslts_bench.detection.run import Report
from gslts_bench.detection.score import fits
from gslts_bench.homes import BenchHome
from gslts_bench.queries.semantic_map import SemanticMap, read_semantic_map
from gslts_bench.runner import BenchRecord, BenchUnit, attempt
from gslts_bench.scale.tile import tile_room
from gslts_sim.task import Task

MAX_TASKS = 20
"""Maximum number of changes of which one must be detected."""
STAGES = (
    "open",
    "index",
    "first detect",
    "detect",
    "localize",
    "words",
    "query",
    "update",
    "commit",
)
"""Stages in the order of the table."""


class Record(BenchRecord):
    """Costs of one map.

    Attributes:
        home: Name of the room.
        rooms: Number of copies.
        gaussians: Size of the map.
        seconds: CPU time by stage, s.
        memory_mib: Maximum memory of the process, MiB.
        changes, objects: Numbers of detected changes and of found objects.
        located: Status of the localization.
        rejected: Reason if the update was rejected.
    """

    home: str
    rooms: int
    gaussians: int = 0
    seconds: dict[str, FiniteFloat] = Field(default_factory=dict)
    memory_mib: FiniteFloat = 0.0
    changes: int = 0
    objects: int = 0
    located: str = ""
    rejected: str | None = None


@dataclass(frozen=True)
class ScaleUnit(BenchUnit[Record, BenchHome]):
    """Work on one home.

    Attributes:
        gaussians: Wanted sizes of the maps; each has a whole number of rooms.
    """

    topic = "scale"
    record = Record

    gaussians: tuple[int, ...]

    @property
    def count(self) -> int:
        """Number of results when all is done."""
        return len(self.gaussians)

    @property
    def settings(self) -> dict[str, Any]:
        """JSON values that decide the results besides map and code."""
        return {"gaussians": list(self.gaussians)}

    def run(self, done: frozenset[str], add: Add) -> None:
        """Measure the maps that have no result yet.

        Args:
            done: Ids of the results of earlier runs.
            add: Receives each result.
        """
        semantic, task = read_semantic_map(self.bench), self._task()
        for wanted in self.gaussians:
            rooms = max(1, round(wanted / semantic.gaussian_map.size))
            record = Record(id=f"{self.name}: {wanted}", home=self.name, rooms=rooms)
            if record.id not in done:
                measured = attempt(record, partial(self._measure, semantic, task, rooms))
                add(measured.model_dump(mode="json"))

    def _task(self) -> Task:
        """Return the first task whose first frame is localized and shows the change."""
        detector = ChangeDetector.of_map(self.bench.map(), DetectionConfig(threads=1))
        relocalizer = Relocalizer.of_map(self.bench.map(), RelocalizationConfig(threads=1))
        home = self.bench.load()
        for task in self.bench.tasks(MAX_TASKS):
            frame = task.start(home, changed=True).observe()
            found = detector.detect(frame).changes
            if any(fits(Report.of(change), task.change) for change in found) and (
                relocalizer.localize(frame).status == "ok"
            ):
                return task
        raise ValueError(f"{self.name}: none of {MAX_TASKS} changes is detected in its map")

    def _measure(self, semantic: SemanticMap, task: Task, rooms: int) -> dict[str, Any]:
        """Make a map of some rooms and measure it in a process of its own."""
        folder = self.bench.map()
        landmarks = read_landmarks(folder)
        assert landmarks is not None  # `make_map` extracts them.
        content = autoencoder_bytes(semantic.codec)
        with TemporaryDirectory(dir=self.bench.work) as name:
            work = Path(name)
            write_map_folder(
                work / "map",
                tile_room(semantic.gaussian_map, rooms),
                {"dataset": self.name},
                cameras_of_map(folder),
                lambda part: {"landmarks": write_landmarks(landmarks, part)},
            )
            model = work / f"{hashlib.sha256(content).hexdigest()}.safetensors"
            model.write_bytes(content)
            job = {
                "map": str(work / "map"),
                "task": task.model_dump(mode="json"),
                "autoencoder": str(model),
                "query": task.change.object_type,
            }
            (work / "job.json").write_text(json.dumps(job))
            command = [sys.executable, "-m", "gslts_bench.scale.measure", str(work / "job.json")]
            finished = subprocess.run(command, capture_output=True, text=True, check=False)
        if finished.returncode:
            raise RuntimeError(finished.stderr.strip().splitlines()[-1])
        found: dict[str, Any] = json.loads(finished.stdout)
        return found


def units_of(homes: Sequence[BenchHome], gaussians: Sequence[int]) -> list[ScaleUnit]:
    """List the work of the benchmark.

    Args:
        homes: The homes.
        gaussians: Wanted sizes of the maps.
    """
    return [ScaleUnit(home, tuple(gaussians)) for home in homes]
