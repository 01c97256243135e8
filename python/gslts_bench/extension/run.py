"""Benchmark of extensions in one home: a map that grows by visits, and one map of all visits."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from pydantic import FiniteFloat

from gslts.core.se3 import fit_rigid_motion, pose_distance, product
from gslts.datasets import Dataset, open_dataset
from gslts.extension.pipeline import extend_map
from gslts.fleet.jobs import Add
from gslts.mapping.config import MappingConfig
from gslts.mapping.engine import make_map
from gslts.mapping.evaluation.evaluate import evaluate, refine_pose
from gslts.mapping.observation import Observation
from gslts.mapping.report.summary import write_result
from gslts.store.map_folder import read_map
from gslts_bench.extension.visits import split_visits
from gslts_bench.homes import BenchHome
from gslts_bench.runner import BenchRecord, BenchUnit, attempt

TYPICAL_DISTANCE_M = 2.0
"""Distance of surfaces from cameras by which a rotation counts as a length, m."""


class Record(BenchRecord):
    """Result of one home.

    Attributes:
        home: Name of the home.
        frames: Number of frames of each visit.
        placed: Number of them that were placed; all of the first.
        psnr_db: PSNR of the test frames after each visit, dB.
        seconds: Time of each visit, s.
        gaussians: Number of Gaussians after each visit.
        all_psnr_db, all_seconds, all_gaussians: The same of one map of all visits.
        shift_cm: Median and maximum distance of the poses of test frames in both maps, cm, after a
            rigid motion of one.
        turn_deg: Their median and maximum angle, degrees.
    """

    home: str
    frames: tuple[int, ...] = ()
    placed: tuple[int, ...] = ()
    psnr_db: tuple[FiniteFloat, ...] = ()
    seconds: tuple[FiniteFloat, ...] = ()
    gaussians: tuple[int, ...] = ()
    all_psnr_db: FiniteFloat = 0.0
    all_seconds: FiniteFloat = 0.0
    all_gaussians: int = 0
    shift_cm: tuple[FiniteFloat, FiniteFloat] = (0.0, 0.0)
    turn_deg: tuple[FiniteFloat, FiniteFloat] = (0.0, 0.0)


@dataclass(frozen=True)
class ExtensionUnit(BenchUnit[Record, BenchHome]):
    """Work on one home.

    Attributes:
        parts: Number of visits to a home of one room.
    """

    topic = "extension"
    record = Record

    parts: int

    @property
    def count(self) -> int:
        """Number of results when all is done."""
        return 1

    @property
    def settings(self) -> dict[str, Any]:
        """JSON values that decide the results besides map and code."""
        return {"parts": self.parts}

    def run(self, done: frozenset[str], add: Add) -> None:
        """Map the visits if there is no result yet.

        Args:
            done: Ids of the results of earlier runs.
            add: Receives the result.
        """
        key = f"{self.name}: visits"
        if key not in done:
            record = Record(id=key, home=self.name)
            add(attempt(record, self._grow).model_dump(mode="json"))

    def _grow(self) -> dict[str, Any]:
        recording = open_dataset(self.bench.recording())
        home = self.bench.default_state().home
        visits, test = split_visits(recording, home, self.parts)
        frames = [Observation.of(frame.read()) for frame in test.frames]
        with TemporaryDirectory(dir=self.bench.work) as name:
            folder = Path(name)
            seconds = [self._map(visits[0], folder / "map")]
            placed, versions = [len(visits[0].frames)], [1]
            for visit in visits[1:]:
                start_s = time.perf_counter()
                outcome = extend_map(folder / "map", visit, self._config)
                seconds.append(time.perf_counter() - start_s)
                placed.append(len(outcome.placement.frames))
                versions.append(outcome.version.number)
            maps = [read_map(folder / f"map@{number}") for number in versions]
            names = {frame.name for visit in visits for frame in visit.frames}
            everything = tuple(frame for frame in recording.frames if frame.name in names)
            whole_s = self._map(replace(recording, frames=everything), folder / "all")
            maps.append(read_map(folder / "all"))
        views = [[refine_pose(state, frame, 1) for frame in frames] for state in maps]
        quality = [evaluate(state, own, 1) for state, own in zip(maps, views, strict=True)]
        return {
            "frames": tuple(len(visit.frames) for visit in visits),
            "placed": tuple(placed),
            "psnr_db": tuple(own.psnr_db for own in quality[:-1]),
            "seconds": tuple(seconds),
            "gaussians": tuple(state.size for state in maps[:-1]),
            "all_psnr_db": quality[-1].psnr_db,
            "all_seconds": whole_s,
            "all_gaussians": maps[-1].size,
            **_differences(views[-2], views[-1]),
        }

    @property
    def _config(self) -> MappingConfig:
        return self.bench.setup.mapping.model_copy(update={"threads": 1})

    def _map(self, visit: Dataset, folder: Path) -> float:
        """Make a map, and return the time, s."""
        start_s = time.perf_counter()
        write_result(folder, make_map(visit, self._config), visit.name)
        return time.perf_counter() - start_s


def _differences(grown: Sequence[Observation], whole: Sequence[Observation]) -> dict[str, Any]:
    """Compare the poses of the same frames in two maps, after a rigid motion of one."""
    first, second = (
        np.array([frame.world_from_camera for frame in frames]) for frames in (grown, whole)
    )
    motion = fit_rigid_motion(first, second, TYPICAL_DISTANCE_M)
    distances = np.array(
        [pose_distance(product(motion, a), b) for a, b in zip(first, second, strict=True)]
    )
    shift_cm, turn_deg = 100 * distances[:, 0], np.rad2deg(distances[:, 1])
    return {
        "shift_cm": (float(np.median(shift_cm)), float(shift_cm.max())),
        "turn_deg": (float(np.median(turn_deg)), float(turn_deg.max())),
    }


def units_of(homes: Sequence[BenchHome], parts: int) -> list[ExtensionUnit]:
    """List the work of the benchmark.

    Args:
        homes: The homes.
        parts: Number of visits to a home of one room.
    """
    return [ExtensionUnit(home, parts) for home in homes]
