"""Benchmark of change detection in one home: reports of detectors about each case, and times."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from functools import cache, cached_property, partial
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, Field, FiniteFloat

from gslts.change.changes import Change, Kind
from gslts.change.detector import ChangeDetector
from gslts.core.frame import RgbdFrame
from gslts.fleet.jobs import Add
from gslts.io.atomic_files import write_atomic
from gslts.localization.config import RelocalizationConfig
from gslts.localization.landmark_files import read_landmarks
from gslts.localization.localizer import Localizer
from gslts.localization.relocalizer import Relocalizer
from gslts.store.map_folder import read_map
from gslts_bench.cache import cached_folder, code_digest
from gslts_bench.detection.cases import (
    Case,
    Counts,
    HomeCases,
    Part,
    counts_of,
    make_cases,
    take_frame,
    take_frames,
)
from gslts_bench.detection.truth import Motion, Truth, as_motion
from gslts_bench.detection.variants import STRATEGIES, VARIANTS
from gslts_bench.detection.watch import WATCH, WATCHED, turn_views, watch
from gslts_bench.homes import BenchHome
from gslts_bench.runner import BenchRecord, BenchUnit, attempt
from gslts_sim.actions import SceneState
from gslts_sim.strict_model import STRICT


class Report(BaseModel):
    """A detected change; see `gslts.change.changes.Change`."""

    model_config = STRICT

    kind: Kind
    confidence: FiniteFloat
    point_m: tuple[FiniteFloat, FiniteFloat, FiniteFloat]
    motion: Motion | None = None

    @classmethod
    def of(cls, change: Change) -> Report:
        """Take what a change is judged by.

        Args:
            change: The detected change.
        """
        x, y, z = change.point.tolist()
        motion = None if change.motion is None else as_motion(change.motion)
        return cls(kind=change.kind, confidence=change.confidence, point_m=(x, y, z), motion=motion)


class Record(BenchRecord):
    """Reports of one detector about one case.

    Attributes:
        case: Home and name of the case, such as `kitchen_0/single_03`.
        part: Part of the benchmark.
        variant: The detector, of `VARIANTS` or `WATCH`.
        truths: Changes that are in view.
        unreliable: Reason if the detector does not answer.
        reports: Detected changes, most confident first.
        ms: Wall time per frame.
        cpu_ms: Time of all threads of the process; less than `ms` where others took the core.
    """

    case: str
    part: Part
    variant: str
    truths: tuple[Truth, ...] = ()
    unreliable: str | None = None
    reports: tuple[Report, ...] = ()
    ms: Annotated[float, Field(ge=0)] = 0.0
    cpu_ms: Annotated[float, Field(ge=0)] = 0.0


@dataclass(frozen=True)
class DetectUnit(BenchUnit[Record, BenchHome]):
    """Work on one home.

    Attributes:
        counts: Number of cases.
        trade: Whether single changes are shown to all of `VARIANTS`.
    """

    topic = "detect"
    record = Record

    counts: Counts
    trade: bool = False

    @property
    def count(self) -> int:
        """Number of results when all is done."""
        return sum(
            wanted * len(self.variants(part))  # type: ignore[arg-type]
            for part, wanted in asdict(self.counts).items()
        )

    @cached_property
    def cases_of(self) -> dict[str, Any]:
        """JSON values that decide the cases."""
        code = code_digest("gslts_bench.detection.cases", without=("gslts.mapping",))
        return {"home": self.bench.recorded_of, "counts": asdict(self.counts), "code": code}

    @property
    def settings(self) -> dict[str, Any]:
        """Values that decide the results besides map and code."""
        return {"cases": self.cases_of}

    def variants(self, part: Part) -> tuple[str, ...]:
        """Return the detectors that see the cases of a part.

        Args:
            part: Part of the benchmark.
        """
        watching = (WATCH,) if part in ("single", "unchanged") else ()
        return (*(VARIANTS if self.trade and part == "single" else STRATEGIES), *watching)

    def is_asked(self, record: Record) -> bool:
        """Return whether this run asks for the detector of a record.

        Args:
            record: A record in the file of results.
        """
        return record.variant in self.variants(record.part)

    def count_missing(self, records: Sequence[Record]) -> int:
        """Return how many of the single changes that were asked for do not exist.

        Args:
            records: Records that are asked for, with errors.
        """
        return self.counts.single - len(
            {record.case for record in records if record.part == "single"}
        )

    def run(self, done: frozenset[str], add: Add) -> None:
        """Run each detector on each case that has no result yet.

        Args:
            done: Ids of the results of earlier runs.
            add: Receives each new result.
        """
        home_cases = self.cases()
        left = {
            case: [name for name in self.variants(case.part) if self._id(case, name) not in done]
            for case in home_cases.cases
        }
        if not any(left.values()):
            return
        detectors = Detectors(self.bench.map())
        before = self.bench.default_state(home_cases.initial_actions)
        for case, variants in left.items():
            take = cache(partial(take_frame, case, before, self.bench))
            for variant in variants:
                if variant == WATCH:
                    answer = partial(self._watch, case, before, detectors)
                else:
                    answer = partial(self._detect, take, detectors, variant)
                record = Record(
                    id=self._id(case, variant),
                    case=f"{self.name}/{case.name}",
                    part=case.part,
                    variant=variant,
                    truths=case.truths,
                )
                add(attempt(record, answer).model_dump(mode="json"))

    def cases(self) -> HomeCases:
        """Return the cases of the home; make them if they are missing."""

        def make(folder: Path) -> None:
            folder.mkdir()
            cases = make_cases(self.bench, self.counts)
            write_atomic(folder / "cases.json", cases.model_dump_json(indent=1).encode())

        folder = cached_folder(self.bench.work / "cases" / self.name, self.cases_of, make)
        return HomeCases.model_validate_json((folder / "cases.json").read_bytes())

    def _id(self, case: Case, variant: str) -> str:
        return f"{self.name}/{case.name}: {variant}"

    def _detect(
        self, take: Callable[[], RgbdFrame], detectors: Detectors, variant: str
    ) -> dict[str, Any]:
        frame, detector = take(), detectors.of(variant)
        clock = _Clock()
        if VARIANTS[variant].locate:
            frame = detectors.localize(frame)
        detection = detector.detect(frame)
        return _answer(detection.unreliable, detection.changes, clock)

    def _watch(self, case: Case, before: SceneState, detectors: Detectors) -> dict[str, Any]:
        frames = take_frames(case, before, self.bench, turn_views(case.viewpoint))
        clock = _Clock(len(frames))
        unreliable, changes = watch(detectors.of(WATCHED), frames)
        return _answer(unreliable, changes, clock)


def units_of(homes: Sequence[BenchHome], tasks: int, *, trade: bool) -> list[DetectUnit]:
    """List the work of the benchmark.

    Args:
        homes: At least one.
        tasks: Number of single changes in all homes.
        trade: Whether speed against accuracy is measured too.
    """
    counts = counts_of(tasks, len(homes))
    return [DetectUnit(home, own, trade) for home, own in zip(homes, counts, strict=True)]


class Detectors:
    """Detectors of one map, made when they are first asked for.

    Args:
        folder: Folder of the map.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._detectors: dict[str, ChangeDetector] = {}
        self._relocalizer = Relocalizer(
            read_map(folder), read_landmarks(folder), RelocalizationConfig(threads=1)
        )

    def of(self, variant: str) -> ChangeDetector:
        """Return the detector of a name in `VARIANTS`.

        Args:
            variant: Name of the variant.
        """
        if variant not in self._detectors:
            self._detectors[variant] = VARIANTS[variant].detector(self._folder)
        return self._detectors[variant]

    def localize(self, frame: RgbdFrame) -> RgbdFrame:
        """Return a frame with the pose that the map gives it, without a prior.

        Args:
            frame: Frame to localize.
        """
        return self.localizer().localize_frame(frame)

    def localizer(self) -> Localizer:
        """Return a localizer for a sequence of frames."""
        return Localizer(self._relocalizer)


class _Clock:
    """Measures the time per frame since it was made."""

    def __init__(self, frames: int = 1) -> None:
        self._frames = frames
        self._start_s, self._start_cpu_s = time.perf_counter(), time.process_time()

    def ms(self) -> dict[str, float]:
        wall_s = time.perf_counter() - self._start_s
        cpu_s = time.process_time() - self._start_cpu_s
        return {"ms": 1000 * wall_s / self._frames, "cpu_ms": 1000 * cpu_s / self._frames}


def _answer(unreliable: str | None, changes: Sequence[Change], clock: _Clock) -> dict[str, Any]:
    times = clock.ms()
    return {"unreliable": unreliable, "reports": tuple(map(Report.of, changes)), **times}
