"""Relocalization in one home: frames are looked for in its map, and judged by what is true."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel

from gslts.core.frame import RgbdFrame
from gslts.localization.landmark_files import read_landmarks
from gslts.localization.relocalizer import Relocalizer
from gslts.store.map_folder import read_map
from gslts.types import Floats
from gslts_bench.cache import code_digest, digest, native_digest
from gslts_bench.homes import MAP_S, RECORDING_S, BenchHome, Tell
from gslts_bench.relocalization.frames import LOOKS, PARTS, SET_S, TASKS_S, Part
from gslts_bench.relocalization.questions import Question, questions_of
from gslts_bench.relocalization.score import Answer, Told, start_near
from gslts_bench.relocalization.variants import ABLATION, OURS, TRADE, VARIANTS
from gslts_bench.work import Add, Result, message_of, validated
from gslts_sim.strict_model import STRICT

FRAME_S, FINDING_S = 0.6, 0.7
"""About how long it takes to see a frame, and to find it, for the progress."""


class Record(BaseModel):
    """What became of one frame, in one way.

    Attributes:
        id: Of frame and variant.
        home: Whose map it was looked for in, such as `kitchen_3`.
        room_type: Of that.
        frame: Where it was taken, and its number, such as `kitchen_3/visit_07`.
        part: What it was asked for.
        variant: Of `VARIANTS`.
        located: From nothing.
        tracked: From a start nearby; None where it was not asked for.
        error: Why there is no result; then the rest says nothing.
    """

    model_config = STRICT

    id: str
    home: str
    room_type: str
    frame: str
    part: Part
    variant: str
    located: Answer | None = None
    tracked: Answer | None = None
    error: str | None = None


@dataclass(frozen=True)
class RelocalizeUnit:
    """One home.

    Attributes:
        bench: The home.
        views: Frames of each part, at most.
        ablation: Whether frames of the home are also looked for in the ways of `ABLATION`.
        trade: Whether frames of the home as mapped are, in those of `TRADE`.
        code: Digests of the code that makes and finds frames; see `HomeSetup`.
    """

    bench: BenchHome
    views: int
    ablation: bool = False
    trade: bool = False
    code: dict[str, Any] = field(default_factory=lambda: _code())

    @property
    def name(self) -> str:
        """That of the home."""
        return self.bench.name

    @property
    def mapped_of(self) -> dict[str, Any]:
        """All that decides what its map is."""
        return self.bench.mapped_of

    @cached_property
    def results(self) -> Path:
        """The file of records; another one when anything that decides them is another."""
        key = digest({"map": self.mapped_of, "views": self.views, "code": self.code})
        return self.bench.work / "relocalize" / f"{self.name}_{key}.jsonl"

    def record_of(self, result: Result) -> Record | None:
        """None of other variants; see `RecordUnit`."""
        record = validated(result, Record, self.results)
        return record if record.variant in self.variants(record.part) else None

    def variants(self, part: Part) -> tuple[str, ...]:
        """The ways in which frames of a part are looked for."""
        own = part != "another home"
        return (
            OURS,
            *(ABLATION if self.ablation and own else ()),
            *(TRADE if self.trade and part == "as mapped" else ()),
        )

    def seconds(self, done: frozenset[str]) -> float:
        """About how long it takes."""
        wanted = self.views * sum(len(self.variants(part)) for part in PARTS)
        work = FINDING_S * wanted + FRAME_S * self.views * len(PARTS)
        making = 3 * TASKS_S + SET_S * self.views / LOOKS
        whole = making + MAP_S + RECORDING_S * self.bench.setup.frames
        return max(0, wanted - len(done)) / wanted * work + (0 if done else whole)

    def run(self, done: frozenset[str], add: Add, tell: Tell) -> None:
        """Looks for what was not looked for yet.

        Raises:
            ValueError: The home gives no frames, or no map can be made of it.
            OSError: The disk is full.
        """
        asked = list(questions_of(self.bench, self.views, self.code["frames"], tell))
        left = {one: self._left(one, done) for one in asked}
        if not any(left.values()):
            return
        finders = Finders(self.bench.map(tell))
        for question, variants in left.items():
            look = cache(question.look)
            for variant in variants:
                add(self._record(question, variant, look, finders).model_dump(mode="json"))
                tell(FINDING_S)
            tell(FRAME_S if variants else 0)

    def _left(self, question: Question, done: frozenset[str]) -> list[str]:
        variants = self.variants(question.part)
        return [one for one in variants if _id(question, one) not in done]

    def _record(
        self,
        question: Question,
        variant: str,
        look: Callable[[], tuple[RgbdFrame, Floats]],
        finders: Finders,
    ) -> Record:
        record = Record(
            id=_id(question, variant),
            home=self.name,
            room_type=self.bench.room_type,
            frame=question.frame,
            part=question.part,
            variant=variant,
        )
        try:
            found = _found(finders.of(variant), *look(), question, variant)
        except Exception as error:  # Whatever fails is told of its frame; others go on.
            found = {"error": message_of(error)}
        return record.model_copy(update=found)


class Finders:
    """Relocalizers of one map, made when they are asked for.

    Args:
        folder: Of the map.
    """

    def __init__(self, folder: Path) -> None:
        self._map, self._landmarks = read_map(folder), read_landmarks(folder)
        self._made: dict[str, Relocalizer] = {}

    def of(self, variant: str) -> Relocalizer:
        """The one of that name, of `VARIANTS`."""
        if variant not in self._made:
            config = VARIANTS[variant]
            self._made[variant] = Relocalizer(self._map, self._landmarks, config)
        return self._made[variant]


def _found(
    relocalizer: Relocalizer, frame: RgbdFrame, true: Floats, question: Question, variant: str
) -> dict[str, Any]:
    """What a record tells besides what was asked."""
    located = Told.by(lambda: relocalizer.locate(frame))
    if question.is_strange:
        return {"located": located.answer(None)}
    if variant != OURS:
        return {"located": located.answer(true)}
    start = start_near(true, np.random.default_rng([question.seed, 1]))
    return {
        "located": located.answer(true),
        "tracked": Told.by(lambda: relocalizer.track(frame, start)).answer(true),
    }


def _id(question: Question, variant: str) -> str:
    return f"{question.frame}: {variant}"


def _code() -> dict[str, Any]:
    return {
        "frames": code_digest("gslts_bench.relocalization.frames", without=("gslts.mapping",)),
        "finding": {"python": code_digest(__name__), "native": native_digest()},
    }
