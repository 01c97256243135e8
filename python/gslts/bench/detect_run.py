"""The detectors at work in one home: what they report about each case, and how fast."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from functools import cache, cached_property, partial
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field, FiniteFloat

from gslts.bench.detect_cases import (
    CASES_CODE,
    Case,
    Counts,
    HomeCases,
    Part,
    cases_of,
    frame_of,
)
from gslts.bench.detect_truth import Truth
from gslts.bench.detect_variants import STRATEGIES, VARIANTS
from gslts.bench.homes import MAP_S, RECORDING_S, BenchHome, default_state
from gslts.bench.made import code_of, digest, made, native_code
from gslts.bench.work import Add, Tell, message_of
from gslts.camera_files import read_cameras
from gslts.change.changes import Change
from gslts.change.detect import ChangeDetector
from gslts.files import write_whole
from gslts.frame import RgbdFrame
from gslts.map_folder import CAMERAS, read_map
from gslts.sim.home_source import STRICT

DETECT_CODE = (
    *("alignment", "camera", "camera_files", "change", "files", "frame", "gaussian_map"),
    *("losses", "map_folder", "ply", "render"),
    *("bench/detect_run", "bench/detect_variants"),
)
"""What decides what is detected in a frame, besides the compiled module."""
CASE_S: dict[Part, float] = {"single": 0.5, "pair": 0.5, "triple": 0.8, "unchanged": 0.1}
FRAME_S, DETECTION_S = 0.6, 0.1
"""About how long it takes to make a case, to see it and to look for changes, for the progress."""


class Report(BaseModel):
    """A change that was detected; see `gslts.change.detect.Change`."""

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
        variant: The detector, of `VARIANTS`.
        truths: What differs.
        unreliable: Why nothing can be said.
        reports: The most certain first.
        ms: Wall time of the detection.
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

    def variants(self, part: Part) -> tuple[str, ...]:
        """The detectors that see the cases of a part."""
        return tuple(VARIANTS if self.trade and part == "single" else STRATEGIES)

    def seconds(self, done: frozenset[str]) -> float:
        """About how long it takes."""
        counts: dict[Part, int] = asdict(self.counts)  # type: ignore[assignment]
        wanted = sum(counts[part] * len(self.variants(part)) for part in CASE_S)
        left = max(0, wanted - len(done))
        looks = sum(counts.values()) if not done else left / len(STRATEGIES)
        made = sum(counts[part] * seconds for part, seconds in CASE_S.items())
        whole = MAP_S + RECORDING_S * self.bench.setup.frames
        return looks * FRAME_S + left * DETECTION_S + (0 if done else made + whole)

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
            if variants:
                tell(FRAME_S)
            for variant in variants:
                add(self._record(case, variant, look, detectors).model_dump(mode="json"))
                tell(DETECTION_S)

    def cases(self, tell: Tell = lambda _: None) -> HomeCases:
        """The cases of the home, made unless they are there."""

        def make(folder: Path) -> None:
            folder.mkdir()
            cases = cases_of(self.bench, self.counts, lambda part: tell(CASE_S[part]))
            write_whole(folder / "cases.json", cases.model_dump_json(indent=1).encode())

        folder = made(self.bench.work / "cases" / self.name, self._cases_of, make)
        return HomeCases.model_validate_json((folder / "cases.json").read_bytes())

    @property
    def _cases_of(self) -> dict[str, Any]:
        recorded = self.bench.recorded_of
        return {"home": recorded, "counts": asdict(self.counts), "code": self.code["cases"]}

    def _id(self, case: Case, variant: str) -> str:
        return f"{self.name}/{case.name}: {variant}"

    def _record(
        self, case: Case, variant: str, look: Callable[[], RgbdFrame], detectors: Detectors
    ) -> Record:
        record = Record(
            id=self._id(case, variant),
            case=f"{self.name}/{case.name}",
            part=case.part,
            variant=variant,
            truths=case.truths,
        )
        try:
            frame, detector = look(), detectors.of(variant)
            start_s, start_cpu_s = time.perf_counter(), time.process_time()
            detection = detector.detect(frame)
            end_s, end_cpu_s = time.perf_counter(), time.process_time()
        except Exception as error:  # Whatever fails is told of its case; others go on.
            return record.model_copy(update={"error": message_of(error)})
        found = {
            "unreliable": detection.unreliable,
            "reports": tuple(map(_report, detection.changes)),
            "ms": 1000 * (end_s - start_s),
            "cpu_ms": 1000 * (end_cpu_s - start_cpu_s),
        }
        return record.model_copy(update=found)


class Detectors:
    """Those of one map, made when they are asked for.

    Args:
        folder: Of the map.
    """

    def __init__(self, folder: Path) -> None:
        self._map = read_map(folder)
        self._cameras = read_cameras(folder / CAMERAS).values()
        self._made: dict[str, ChangeDetector] = {}

    def of(self, variant: str) -> ChangeDetector:
        """The detector of that name, of `VARIANTS`."""
        if variant not in self._made:
            self._made[variant] = VARIANTS[variant].detector(self._map, self._cameras)
        return self._made[variant]


def _report(change: Change) -> Report:
    x, y, z = change.point.tolist()
    return Report(kind=change.kind, confidence=change.confidence, point_m=(x, y, z))


def _code() -> dict[str, Any]:
    return {
        "cases": code_of(*CASES_CODE),
        "detect": {"python": code_of(*DETECT_CODE), "native": native_code()},
    }
