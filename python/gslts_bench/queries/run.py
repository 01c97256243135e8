"""Localisation in one home: objects of some categories are asked for, in maps taught in some ways.

Source: GS-LTS, sec. IV-D, 3D Localization.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, FiniteFloat
from scipy.optimize import linear_sum_assignment

from gslts.semantics.embed import embed_semantics
from gslts.semantics.queries import Instance, SemanticQueries
from gslts.semantics.source import Oracle
from gslts.store.map_folder import read_map
from gslts.types import Floats
from gslts_bench.cache import code_digest, digest, native_digest
from gslts_bench.homes import MAP_S, RECORDING_S, BenchHome, default_state
from gslts_bench.queries.semantic_homes import SEMANTICS_S, frames_of
from gslts_bench.work import Add, Result, Tell, message_of, validated
from gslts_sim.home_source import HomeSource
from gslts_sim.strict_model import STRICT

CATEGORIES = (
    *("AlarmClock", "ArmChair", "Bed", "Bread", "Chair", "CoffeeMachine", "DeskLamp"),
    *("DiningTable", "Dresser", "Dumbbell", "RemoteControl", "Sofa"),
)
"""Those of the paper."""


@dataclass(frozen=True)
class Variant:
    """A way to make a map that is asked.

    Attributes:
        code: Length of a code, d.
        refine: Steps of gradient descent after the lifting.
        width, height: Of the images, px; 0 means those of the run.
        frames_share: Of the frames of the run.
    """

    code: int = 32
    refine: int = 0
    width: int = 0
    height: int = 0
    frames_share: float = 1.0

    def home(self, bench: BenchHome) -> BenchHome:
        """The same home, recorded as this variant wants it."""
        setup = bench.setup
        setup = replace(
            setup,
            width=self.width or setup.width,
            height=self.height or setup.height,
            frames=round(self.frames_share * setup.frames),
        )
        return replace(bench, setup=setup)


OURS = "d = 32"
TRADE = {"d = 8": Variant(code=8), "d = 16": Variant(code=16), "d = 64": Variant(code=64)}
ABLATION = {
    "refined by gradient, 600 steps": Variant(refine=600),
    "images of 300x300": Variant(width=300, height=300),
    "60 % of the frames": Variant(frames_share=0.6),
}


class Found(BaseModel):
    """What became of one object.

    Attributes:
        object_id: In the home.
        category: Of `CATEGORIES`.
        iou: Of its box and the one that was found for it; 0 if none was.
    """

    model_config = STRICT

    object_id: str
    category: str
    iou: FiniteFloat


class Record(BaseModel):
    """What was found in one home, in one way.

    Attributes:
        id: Of the variant.
        home: Its name.
        variant: `OURS`, or of `TRADE` or `ABLATION`.
        found: One for each object.
        extra: Instances that were found and are none.
        absent: Categories that the home lacks, and of which something was found; and all it lacks.
        gaussians, feature_bytes: Of the map.
        teach_s: Autoencoder, lifting and refinement.
        query_s: Of each query.
        error: Why there is no result.
    """

    model_config = STRICT

    id: str
    home: str
    variant: str
    found: tuple[Found, ...] = ()
    extra: int = 0
    absent: tuple[int, int] = (0, 0)
    gaussians: int = 0
    feature_bytes: int = 0
    teach_s: FiniteFloat = 0.0
    query_s: tuple[FiniteFloat, ...] = ()
    error: str | None = None


@dataclass(frozen=True)
class LocalizeUnit:
    """One home.

    Attributes:
        bench: The home.
        variants: Ways to make its map, by name.
        code: Digests of the code that finds things; see `HomeSetup`.
    """

    bench: BenchHome
    variants: dict[str, Variant]
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
        key = digest({"map": self.bench.mapped_of, "code": self.code})
        return self.bench.work / "localize" / f"{self.name}_{key}.jsonl"

    def record_of(self, result: Result) -> Record | None:
        """None of other variants; see `RecordUnit`."""
        record = validated(result, Record, self.results)
        return record if record.variant in self.variants else None

    def seconds(self, done: frozenset[str]) -> float:
        """About how long it takes."""
        return sum(
            SEMANTICS_S + MAP_S + RECORDING_S * variant.home(self.bench).setup.frames
            for name, variant in self.variants.items()
            if name not in done
        )

    def run(self, done: frozenset[str], add: Add, tell: Tell) -> None:
        """Teaches and asks in each way that was not tried yet."""
        for name, variant in self.variants.items():
            if name in done:
                continue
            try:
                record = self._asked(name, variant, tell)
            except Exception as error:  # Whatever fails is told of its variant; others go on.
                record = Record(id=name, home=self.name, variant=name, error=message_of(error))
            add(record.model_dump(mode="json"))

    def _asked(self, name: str, variant: Variant, tell: Tell) -> Record:
        bench, oracle = variant.home(self.bench), Oracle()
        gaussian_map = read_map(bench.map(tell))
        start_s = time.perf_counter()
        frames = frames_of(bench, tell)
        taught = embed_semantics(
            gaussian_map, frames, oracle, variant.code, variant.refine, threads=1
        )
        teach_s = time.perf_counter() - start_s
        queries = SemanticQueries(
            replace(gaussian_map, features=taught.features), taught.autoencoder, oracle
        )
        record = Record(
            id=name,
            home=self.name,
            variant=name,
            gaussians=gaussian_map.size,
            feature_bytes=taught.features.nbytes,
            teach_s=teach_s,
        )
        return record.model_copy(update=_answers(queries, _boxes_of(bench)))


def _boxes_of(bench: BenchHome) -> dict[str, dict[str, Floats]]:
    """Of each category the boxes [2,3] of all its objects, by id."""
    task = bench.tasks(1)[0]
    assert isinstance(task.home, HomeSource)  # As it comes from a seed.
    home = default_state(task.home, task.initial_actions).home
    return {
        category: {
            thing.id: np.asarray(thing.box_in_world)
            for thing in home.objects
            if thing.type == category
        }
        for category in CATEGORIES
    }


def _answers(queries: SemanticQueries, truth: dict[str, dict[str, Floats]]) -> dict[str, Any]:
    """What is found of each category, beside what is there."""
    found: list[Found] = []
    query_s: list[float] = []
    extra = wrong = 0
    for category, boxes in truth.items():
        start_s = time.perf_counter()
        instances = queries.find(category)
        query_s.append(time.perf_counter() - start_s)
        ious = best_ious(list(boxes.values()), instances)
        found += [
            Found(object_id=one, category=category, iou=iou)
            for one, iou in zip(boxes, ious, strict=True)
        ]
        extra += len(instances) - int(np.count_nonzero(ious))
        wrong += not boxes and bool(instances)
    absent = sum(not boxes for boxes in truth.values())
    return {
        "found": tuple(found),
        "extra": extra,
        "absent": (wrong, absent),
        "query_s": tuple(query_s),
    }


def best_ious(boxes: list[Floats], instances: list[Instance]) -> list[float]:
    """Of each box [2,3] that with its instance, where each instance serves one box at most."""
    ious = np.zeros((len(boxes), len(instances)))
    for row, box in enumerate(boxes):
        for column, one in enumerate(instances):
            ious[row, column] = iou_of(box, np.stack([one.low, one.high]))
    rows, columns = linear_sum_assignment(ious, maximize=True)
    result = np.zeros(len(boxes))
    result[rows] = ious[rows, columns]
    return [float(one) for one in result]


def iou_of(a: Floats, b: Floats) -> float:
    """Intersection over union of two boxes [2,3], lower and upper corner."""
    common = np.prod(np.maximum(0, np.minimum(a[1], b[1]) - np.maximum(a[0], b[0])))
    union = np.prod(a[1] - a[0]) + np.prod(b[1] - b[0]) - common
    return float(common / union) if union > 0 else 0.0
