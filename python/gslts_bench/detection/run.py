"""The detectors at work in one home: what they report about each case, and how fast."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, field
from functools import cache, cached_property, partial
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field, FiniteFloat

from gslts.change.changes import Change
from gslts.change.detector import ChangeDetector
from gslts.core.frame import RgbdFrame
from gslts.io.atomic_files import write_whole
from gslts.localization.config import RelocalizationConfig
from gslts.localization.landmark_files import read_landmarks
from gslts.localization.localizer import Localizer
from gslts.localization.relocalizer import Relocalizer
from gslts.store.camera_files import cameras_of_map
from gslts.store.map_folder import read_map
from gslts_bench.cache import cached_folder, code_digest, digest, native_digest
from gslts_bench.detection.cases import (
    Case,
    Counts,
    HomeCases,
    Part,
    cases_of,
    frame_of,
    frames_of,
)
from gslts_bench.detection.truth import Truth
from gslts_bench.detection.variants import STRATEGIES, VARIANTS
from gslts_bench.detection.watch import TURNS_DEG, WATCH, WATCHED, looks_around, watched
from gslts_bench.homes import MAP_S, RECORDING_S, BenchHome, default_state
from gslts_bench.work import Add, Result, Tell, message_of, validated
from gslts_sim.actions import SceneState
from gslts_sim.strict_model import STRICT

CASE_S: dict[Part, float] = {"single": 0.5, "pair": 0.5, "triple": 0.8, "unchanged": 0.1}
FRAME_S, DETECTION_S = 0.6, 0.1
"""About how long it takes to make a case, to see it and to look for changes, for the progress."""


class Report(BaseModel):
    """A change that was detected; see `gslts.change.detector.Change`."""

    model_config = STRICT

    kind: Literal["addition", "removal", "relocation"]
    confidence: FiniteFloat
    point_m: tuple[FiniteFloat, FiniteFloat, FiniteFloat]


class Record(BaseModel):
    """What one detector says about one case.

    Attributes:
        id: Of case and detector.
        case: Its home and its name, such as `kitchen_0/single_03`.
        part: Of the benchmark.
        variant: The detector, of `VARIANTS` or `WATCH`.
        truths: What differs.
        unreliable: Why nothing can be said.
        reports: The most certain first.
        ms: Wall time of the detection, in one frame.
        cpu_ms: Of all threads of the process meanwhile; less than `ms` where others took the core.
        error: Why there is no detection; then the rest says nothing.
    """

    model_config = STRICT

    id: str
    case: str
    part: Part
    variant: str
    truths: tuple[Truth, ...] = ()
    unreliable: str | None = None
    reports: tuple[Report, ...] = ()
    ms: Annotated[float, Field(ge=0)] = 0.0
    cpu_ms: Annotated[float, Field(ge=0)] = 0.0
    error: str | None = None


@dataclass(frozen=True)
class DetectUnit:
    """One home.

    Attributes:
        bench: The home.
        counts: How many cases.
        trade: Whether single changes are shown to all of `VARIANTS`.
        code: Digests of the code that makes cases and detects; see `HomeSetup`.
    """

    bench: BenchHome
    counts: Counts
    trade: bool = False
    code: dict[str, Any] = field(default_factory=lambda: _code())

    @property
    def name(self) -> str:
        """That of the home."""
        return self.bench.name

    @cached_property
    def results(self) -> Path:
        """The file of records; another one when anything that decides them is another."""
        key = digest(
            {
                "map": self.bench.mapped_of,
                "cases": self._cases_of,
                "code": self.code["detect"],
            }
        )
        return self.bench.work / "detect" / f"{self.name}_{key}.jsonl"

    def record_of(self, result: Result) -> Record | None:
        """None of other detectors; see `RecordUnit`."""
        record = validated(result, Record, self.results)
        return record if record.variant in self.variants(record.part) else None

    def variants(self, part: Part) -> tuple[str, ...]:
        """The detectors that see the cases of a part."""
        watching = (WATCH,) if part in ("single", "unchanged") else ()
        return (*(VARIANTS if self.trade and part == "single" else STRATEGIES), *watching)

    def seconds(self, done: frozenset[str]) -> float:
        """About how long it takes."""
        counts: dict[Part, int] = asdict(self.counts)  # type: ignore[assignment]
        wanted = sum(counts[part] * len(self.variants(part)) for part in CASE_S)
        frames = sum(counts[part] * _frames(self.variants(part)) for part in CASE_S)
        made = sum(counts[part] * seconds for part, seconds in CASE_S.items())
        whole = MAP_S + RECORDING_S * self.bench.setup.frames
        share_left = max(0, wanted - len(done)) / max(1, wanted)
        seeing = frames * FRAME_S + wanted * DETECTION_S
        return share_left * seeing + (0 if done else made + whole)

    def run(self, done: frozenset[str], add: Add, tell: Tell) -> None:
        """Detects what was not detected yet.

        Raises:
            ValueError: The home gives no case, or no map can be made of it.
            OSError: The disk is full.
        """
        told = self.cases(tell)
        left = {
            case: [one for one in self.variants(case.part) if self._id(case, one) not in done]
            for case in told.cases
        }
        if not any(left.values()):
            return
        detectors = Detectors(self.bench.map(tell))
        before = default_state(told.home, told.initial_actions)
        for case, variants in left.items():
            look = cache(partial(frame_of, case, before, self.bench))
            for variant in variants:
                if variant == WATCH:
                    see = partial(self._watched, case, before, detectors)
                else:
                    see = partial(self._seen, look, detectors, variant)
                add(self._record(case, variant, see).model_dump(mode="json"))
                tell(DETECTION_S)
            tell(FRAME_S * _frames(variants))

    def cases(self, tell: Tell = lambda _: None) -> HomeCases:
        """The cases of the home, made unless they are there."""

        def make(folder: Path) -> None:
            folder.mkdir()
            cases = cases_of(self.bench, self.counts, lambda part: tell(CASE_S[part]))
            write_whole(folder / "cases.json", cases.model_dump_json(indent=1).encode())

        folder = cached_folder(self.bench.work / "cases" / self.name, self._cases_of, make)
        return HomeCases.model_validate_json((folder / "cases.json").read_bytes())

    @property
    def _cases_of(self) -> dict[str, Any]:
        recorded = self.bench.recorded_of
        return {"home": recorded, "counts": asdict(self.counts), "code": self.code["cases"]}

    def _id(self, case: Case, variant: str) -> str:
        return f"{self.name}/{case.name}: {variant}"

    def _record(self, case: Case, variant: str, see: Callable[[], Seen]) -> Record:
        record = Record(
            id=self._id(case, variant),
            case=f"{self.name}/{case.name}",
            part=case.part,
            variant=variant,
            truths=case.truths,
        )
        try:
            seen = see()
        except Exception as error:  # Whatever fails is told of its case; others go on.
            return record.model_copy(update={"error": message_of(error)})
        found = {
            "unreliable": seen.unreliable,
            "reports": tuple(map(report_of, seen.changes)),
            "ms": seen.ms,
            "cpu_ms": seen.cpu_ms,
        }
        return record.model_copy(update=found)

    def _seen(self, look: Callable[[], RgbdFrame], detectors: Detectors, variant: str) -> Seen:
        frame, detector = look(), detectors.of(variant)
        clock = _Clock()
        if VARIANTS[variant].locate:
            frame = detectors.located(frame)
        detection = detector.detect(frame)
        return Seen(detection.unreliable, detection.changes, *clock.ms())

    def _watched(self, case: Case, before: SceneState, detectors: Detectors) -> Seen:
        frames = frames_of(case, before, self.bench, looks_around(case.viewpoint))
        clock = _Clock()
        unreliable, changes = watched(detectors.of(WATCHED), frames)
        return Seen(unreliable, tuple(changes), *clock.ms(len(frames)))


@dataclass(frozen=True, eq=False)
class Seen:
    """What a detector says; see `Record`."""

    unreliable: str | None
    changes: tuple[Change, ...]
    ms: float
    cpu_ms: float


class _Clock:
    """Takes the time since it was made."""

    def __init__(self) -> None:
        self._start_s, self._start_cpu_s = time.perf_counter(), time.process_time()

    def ms(self, frames: int = 1) -> tuple[float, float]:
        """Wall time of each frame, and that of all threads of the process meanwhile."""
        wall_s = time.perf_counter() - self._start_s
        return 1000 * wall_s / frames, 1000 * (time.process_time() - self._start_cpu_s) / frames


class Detectors:
    """Those of one map, made when they are asked for.

    Args:
        folder: Of the map.
    """

    def __init__(self, folder: Path) -> None:
        self._map = read_map(folder)
        self._cameras = cameras_of_map(folder).values()
        self._made: dict[str, ChangeDetector] = {}
        landmarks = read_landmarks(folder)
        self._relocalizer = Relocalizer(self._map, landmarks, RelocalizationConfig(threads=1))

    def of(self, variant: str) -> ChangeDetector:
        """The detector of that name, of `VARIANTS`."""
        if variant not in self._made:
            self._made[variant] = VARIANTS[variant].detector(self._map, self._cameras)
        return self._made[variant]

    def located(self, frame: RgbdFrame) -> RgbdFrame:
        """The frame where the map says that it was taken, found from nothing."""
        return Localizer(self._relocalizer).located(frame)


def _frames(variants: Iterable[str]) -> int:
    """How many frames of a case are made for some detectors."""
    single = any(variant != WATCH for variant in variants)
    return single + len(TURNS_DEG) * (WATCH in variants)


def report_of(change: Change) -> Report:
    """What a change is judged by."""
    x, y, z = change.point.tolist()
    return Report(kind=change.kind, confidence=change.confidence, point_m=(x, y, z))


def _code() -> dict[str, Any]:
    return {
        "cases": code_digest("gslts_bench.detection.cases", without=("gslts.mapping",)),
        "detect": {"python": code_digest(__name__), "native": native_digest()},
    }
