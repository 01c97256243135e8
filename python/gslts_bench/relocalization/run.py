"""Benchmark of relocalization in one home: frames are localized in its map, without a prior."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from gslts.core.frame import RgbdFrame
from gslts.fleet.jobs import Add
from gslts.localization.landmark_files import read_landmarks
from gslts.localization.relocalizer import Relocalizer
from gslts.store.map_folder import read_map
from gslts.types import Floats
from gslts_bench.homes import BenchHome
from gslts_bench.relocalization.frames import PARTS, Part
from gslts_bench.relocalization.score import Answer, TimedAnswer, start_near
from gslts_bench.relocalization.variants import ABLATION, OURS, TRADE, VARIANTS
from gslts_bench.relocalization.views import View, views_of
from gslts_bench.runner import BenchRecord, BenchUnit, attempt


class Record(BenchRecord):
    """Result of one frame with one variant.

    Attributes:
        home: Home of the map, such as `kitchen_3`.
        room_type: Room type of that home.
        frame: Home where it was taken and its name there, such as `kitchen_3/visit_07`.
        part: Part of the benchmark.
        variant: One of `VARIANTS`.
        located: Answer without a prior.
        tracked: Answer from a start nearby; None where that was not asked for.
    """

    home: str
    room_type: str
    frame: str
    part: Part
    variant: str
    located: Answer | None = None
    tracked: Answer | None = None


@dataclass(frozen=True)
class RelocalizeUnit(BenchUnit[Record, BenchHome]):
    """Work on one home.

    Attributes:
        views: Maximum number of frames per part.
        ablation: Whether frames of the home are also localized with `ABLATION`.
        trade: Whether frames of the home as mapped are also localized with `TRADE`.
    """

    topic = "relocalize"
    record = Record

    views: int
    ablation: bool = False
    trade: bool = False

    @property
    def count(self) -> int:
        """Number of results when all is done."""
        return self.views * sum(len(self.variants(part)) for part in PARTS)

    @property
    def settings(self) -> dict[str, Any]:
        """Values that decide the results besides map and code."""
        return {"views": self.views}

    def is_asked(self, record: Record) -> bool:
        """Return whether this run asks for the variant of a record.

        Args:
            record: A record in the file of results.
        """
        return record.variant in self.variants(record.part)

    def variants(self, part: Part) -> tuple[str, ...]:
        """Return the variants that localize the frames of a part.

        Args:
            part: Part of the benchmark.
        """
        own = part != "another home"
        return (
            OURS,
            *(ABLATION if self.ablation and own else ()),
            *(TRADE if self.trade and part == "as mapped" else ()),
        )

    def run(self, done: frozenset[str], add: Add) -> None:
        """Localize each frame that has no result yet.

        Args:
            done: Ids of the results of earlier runs.
            add: Receives each new result.
        """
        left = {
            view: [
                variant for variant in self.variants(view.part) if _id(view, variant) not in done
            ]
            for view in views_of(self.bench, self.views)
        }
        if not any(left.values()):
            return
        relocalizers = Relocalizers(self.bench.map())
        for view, variants in left.items():
            take = cache(view.take)
            for variant in variants:
                record = Record(
                    id=_id(view, variant),
                    home=self.name,
                    room_type=self.bench.room_type,
                    frame=view.frame,
                    part=view.part,
                    variant=variant,
                )
                ask = partial(_localize, relocalizers, view, variant, take)
                add(attempt(record, ask).model_dump(mode="json"))


def units_of(
    homes: Sequence[BenchHome], views: int, *, ablation: bool, trade: bool
) -> list[RelocalizeUnit]:
    """List the work in homes; for the arguments see `RelocalizeUnit`.

    Args:
        homes: The homes.
        views: Maximum number of frames per part.
        ablation: Whether the variants of `ABLATION` are measured too.
        trade: Whether the variants of `TRADE` are measured too.
    """
    return [RelocalizeUnit(home, views, ablation, trade) for home in homes]


class Relocalizers:
    """Relocalizers of one map, made when they are first asked for.

    Args:
        folder: Folder of the map.
    """

    def __init__(self, folder: Path) -> None:
        self._map, self._landmarks = read_map(folder), read_landmarks(folder)
        self._relocalizers: dict[str, Relocalizer] = {}

    def of(self, variant: str) -> Relocalizer:
        """Return the relocalizer of a name in `VARIANTS`.

        Args:
            variant: Name of the variant.
        """
        if variant not in self._relocalizers:
            config = VARIANTS[variant]
            self._relocalizers[variant] = Relocalizer(self._map, self._landmarks, config)
        return self._relocalizers[variant]


def _localize(
    relocalizers: Relocalizers,
    view: View,
    variant: str,
    take: Callable[[], tuple[RgbdFrame, Floats]],
) -> dict[str, Any]:
    """Localize a frame and judge the answers; return fields of `Record`."""
    relocalizer, (frame, true) = relocalizers.of(variant), take()
    located = TimedAnswer.of(lambda: relocalizer.localize(frame))
    if view.is_foreign:
        return {"located": located.judge(None)}
    if variant != OURS:
        return {"located": located.judge(true)}
    start = start_near(true, np.random.default_rng([view.seed, 1]))
    tracked = TimedAnswer.of(lambda: relocalizer.track(frame, start))
    return {"located": located.judge(true), "tracked": tracked.judge(true)}


def _id(view: View, variant: str) -> str:
    return f"{view.frame}: {variant}"
