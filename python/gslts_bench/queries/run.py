"""Benchmark of queries in one home: categories are asked for by name, and boxes are compared.

Source: GS-LTS, sec. IV-D, 3D Localization.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, FiniteFloat
from scipy.optimize import linear_sum_assignment

from gslts.core.boxes import box_iou
from gslts.fleet.jobs import Add
from gslts.semantics.class_names import ClassNames
from gslts.semantics.detector_source import DetectorSource
from gslts.semantics.embed import embed_semantics
from gslts.semantics.queries import Instance, SemanticQueries
from gslts.semantics.source import Oracle, SemanticSource
from gslts.store.map_folder import read_map
from gslts.types import Floats
from gslts_bench.homes import BenchHome, movable_types
from gslts_bench.queries.noisy_detector import SURFACES, NoisyDetector
from gslts_bench.queries.semantic_map import mapped_frames
from gslts_bench.runner import BenchRecord, BenchUnit, attempt
from gslts_sim.strict_model import STRICT

CATEGORIES = (
    *("AlarmClock", "ArmChair", "Bed", "Bread", "Chair", "CoffeeMachine", "DeskLamp"),
    *("DiningTable", "Dresser", "Dumbbell", "RemoteControl", "Sofa"),
)
"""The twelve categories of GS-LTS."""


@dataclass(frozen=True)
class Variant:
    """Settings of a semantic map that is compared.

    Attributes:
        code: Length of a Gaussian's feature, d.
        refine: Steps of gradient descent after the closed form.
        width, height: Size of the images, px; 0 means that of the run.
        frames_share: Share of the frames of the run.
        detector: "boxes" or "masks" of a `NoisyDetector` that are used instead of the labels.
    """

    code: int = 32
    refine: int = 0
    width: int = 0
    height: int = 0
    frames_share: float = 1.0
    detector: Literal["", "boxes", "masks"] = ""

    def home(self, bench: BenchHome) -> BenchHome:
        """Return a home with the recording of this variant.

        Args:
            bench: The home with the settings of the run.
        """
        setup = bench.setup
        setup = replace(
            setup,
            width=self.width or setup.width,
            height=self.height or setup.height,
            frames=round(self.frames_share * setup.frames),
        )
        return replace(bench, setup=setup)


OURS = "d = 32"
"""Name of the default."""
TRADE = {"d = 8": Variant(code=8), "d = 16": Variant(code=16), "d = 64": Variant(code=64)}
"""Variants for accuracy against memory and time."""
ABLATION = {
    "refined by gradient, 600 steps": Variant(refine=600),
    "images of 300x300": Variant(width=300, height=300),
    "60 % of the frames": Variant(frames_share=0.6),
}
DETECTOR = {
    "detector of boxes": Variant(detector="boxes"),
    "detector with masks": Variant(detector="masks"),
}
"""Variants that differ from the default in one setting, and a detector with errors."""


class Found(BaseModel):
    """Result of one object.

    Attributes:
        object_id: Object in the home.
        category: One of `CATEGORIES`; in a foreign home, also of its movable objects.
        iou: Intersection over union of its box and the one found for it; 0 if none was.
    """

    model_config = STRICT

    object_id: str
    category: str
    iou: FiniteFloat


class Record(BenchRecord):
    """Result of one home with one variant.

    Attributes:
        home: Name of the home.
        variant: `OURS`, or one of `TRADE` or `ABLATION`.
        found: Results of all objects.
        extra: Number of boxes that belong to no object.
        absent: Number of categories that the home lacks with a box all the same, and of all that it
            lacks.
        gaussians, feature_bytes: Size of the map and of its features.
        embedding_s: Time of autoencoder, closed form and refinement.
        query_s: Time of each query.
    """

    home: str
    variant: str
    found: tuple[Found, ...] = ()
    extra: int = 0
    absent: tuple[int, int] = (0, 0)
    gaussians: int = 0
    feature_bytes: int = 0
    embedding_s: FiniteFloat = 0.0
    query_s: tuple[FiniteFloat, ...] = ()


@dataclass(frozen=True)
class QueryUnit(BenchUnit[Record, BenchHome]):
    """Work on one home.

    Attributes:
        variants: Settings of its maps, by name.
    """

    topic = "queries"
    record = Record

    variants: dict[str, Variant]

    @property
    def count(self) -> int:
        """Number of results when all is done."""
        return len(self.variants)

    def is_asked(self, record: Record) -> bool:
        """Return whether this run asks for the variant of a record.

        Args:
            record: A record in the file of results.
        """
        return record.variant in self.variants

    def run(self, done: frozenset[str], add: Add) -> None:
        """Make and query the semantic maps of variants that have no result yet.

        Args:
            done: Ids of the results of earlier runs.
            add: Receives each new result.
        """
        for name, variant in self.variants.items():
            key = f"{self.name}: {name}"
            if key not in done:
                record = Record(id=key, home=self.name, variant=name)
                add(attempt(record, partial(self._ask, variant)).model_dump(mode="json"))

    def _ask(self, variant: Variant) -> dict[str, Any]:
        bench = variant.home(self.bench)
        source: SemanticSource = Oracle()
        if variant.detector:
            source = _noisy_source(bench, masks=variant.detector == "masks")
        gaussian_map = read_map(bench.map())
        start_s = time.perf_counter()
        frames = mapped_frames(bench)
        semantics = embed_semantics(
            gaussian_map, frames, source, variant.code, variant.refine, threads=1
        )
        embedding_s = time.perf_counter() - start_s
        queries = SemanticQueries(
            replace(gaussian_map, features=semantics.features), semantics.codec, source
        )
        return {
            "gaussians": gaussian_map.size,
            "feature_bytes": semantics.features.nbytes,
            "embedding_s": embedding_s,
            **_compare(queries, _true_boxes(bench)),
        }


def _noisy_source(bench: BenchHome, *, masks: bool) -> DetectorSource:
    """Return a source with a detector of all types of a home that detectors know."""
    types = {known.type for known in bench.default_state().home.objects}
    names = sorted({*types, *CATEGORIES} - {*SURFACES})
    return DetectorSource(ClassNames(names), NoisyDetector(names, bench.seed, masks=masks))


def units_of(
    homes: Sequence[BenchHome], *, trade: bool, ablation: bool, detector: bool = False
) -> list[QueryUnit]:
    """List the work of the benchmark.

    Args:
        homes: The homes.
        trade: Whether features of other lengths are measured too.
        ablation: Whether the variants of `ABLATION` are measured too.
        detector: Whether a simulated detector is measured too.
    """
    variants = {OURS: Variant(), **(TRADE if trade else {}), **(ABLATION if ablation else {})}
    variants |= DETECTOR if detector else {}
    return [QueryUnit(home, variants) for home in homes]


def best_ious(boxes: list[Floats], instances: list[Instance]) -> list[float]:
    """Assign instances to boxes, each to at most one, with the greatest sum of IoU.

    Args:
        boxes: True boxes [2,3], m.
        instances: Boxes that were found.

    Returns:
        IoU of each true box with its instance; 0 without one.
    """
    ious = np.zeros((len(boxes), len(instances)))
    for row, box in enumerate(boxes):
        for column, instance in enumerate(instances):
            ious[row, column] = box_iou(box, np.stack([instance.low, instance.high]))
    rows, columns = linear_sum_assignment(ious, maximize=True)
    result = np.zeros(len(boxes))
    result[rows] = ious[rows, columns]
    return [float(iou) for iou in result]


def _true_boxes(bench: BenchHome) -> dict[str, dict[str, Floats]]:
    """Return the boxes [2,3] of all objects by category and id."""
    home = bench.default_state().home
    types = [] if bench.file is None else movable_types(home)
    return {
        category: {
            known.id: np.asarray(known.box_in_world)
            for known in home.objects
            if known.type == category
        }
        for category in dict.fromkeys((*CATEGORIES, *types))
    }


def _compare(queries: SemanticQueries, truth: dict[str, dict[str, Floats]]) -> dict[str, Any]:
    """Ask for all categories and compare with the true boxes."""
    found: list[Found] = []
    query_s: list[float] = []
    extra = wrong = 0
    for category, boxes in truth.items():
        start_s = time.perf_counter()
        instances = queries.find(category)
        query_s.append(time.perf_counter() - start_s)
        ious = best_ious(list(boxes.values()), instances)
        found += [
            Found(object_id=name, category=category, iou=iou)
            for name, iou in zip(boxes, ious, strict=True)
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
