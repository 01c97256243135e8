"""Relocalization in a recorded room: the frames that a map was made without are looked for in it.

They are judged by the poses of the data set, and by those that mapping corrects them to: the first
err by centimetres, the second by what two maps of the same room differ.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from gslts.datasets import Frame
from gslts.localization.relocalizer import Relocalizer
from gslts.mapping.evaluation.held_out import TrainingRecord
from gslts.types import Floats
from gslts_bench.cache import code_digest, digest, native_digest
from gslts_bench.homes import Tell
from gslts_bench.relocalization.room import FOLDS, ROOM_S, RecordedRoom, brought_to
from gslts_bench.relocalization.run import FINDING_S, Finders
from gslts_bench.relocalization.score import Answer, Told
from gslts_bench.relocalization.variants import OURS
from gslts_bench.work import Add, Result, message_of, validated
from gslts_sim.strict_model import STRICT


class RoomRecord(BaseModel):
    """What became of one frame.

    Attributes:
        id: That of the frame.
        fold: Of the map that was made without it.
        given: As judged by the pose of the data set.
        corrected: As judged by the one that mapping corrects it to.
        error: Why there is no result; then the rest says nothing.
    """

    model_config = STRICT

    id: str
    fold: int
    given: Answer | None = None
    corrected: Answer | None = None
    error: str | None = None


@dataclass(frozen=True)
class FoldUnit:
    """An eighth of the frames of a room.

    Attributes:
        room: The room.
        fold: Number of the first of its frames, 0 to 7.
        code: Digests of the code that finds frames; see `HomeSetup`.
    """

    room: RecordedRoom
    fold: int
    code: dict[str, Any] = field(
        default_factory=lambda: {"python": code_digest(__name__), "native": native_digest()}
    )

    @property
    def name(self) -> str:
        """Such as `7scenes_without_3`."""
        return f"{self.room.name}_without_{self.fold}"

    @property
    def mapped_of(self) -> dict[str, Any]:
        """All that decides what its map is."""
        return self.room.mapped_of(self.fold)

    @cached_property
    def results(self) -> Path:
        """The file of records; another one when anything that decides them is another."""
        key = digest({"map": self.mapped_of, "code": self.code})
        return self.room.work / "relocalize" / f"{self.name}_{key}.jsonl"

    def record_of(self, result: Result) -> RoomRecord:
        """See `RecordUnit`."""
        return validated(result, RoomRecord, self.results)

    def seconds(self, done: frozenset[str]) -> float:
        """About how long it takes, with a share of the map of all frames."""
        left = len(self.frames) - len(done)
        return FINDING_S * left + (0 if done else ROOM_S * (1 + 1 / FOLDS))

    @cached_property
    def frames(self) -> tuple[Frame, ...]:
        """Those that are looked for."""
        return self.room.dataset.frames[self.fold :: FOLDS]

    def run(self, done: frozenset[str], add: Add, tell: Tell) -> None:
        """Looks for what was not looked for yet; not for frames that mapping cannot use.

        Raises:
            ValueError: No map can be made.
            OSError: The disk is full.
        """
        frames = [one for one in self.frames if one.name not in done]
        if not frames:
            return
        folder = self.room.map(self.fold, tell)
        known, relocalizer = TrainingRecord.read(folder), Finders(folder).of(OURS)
        in_map = {name: one.world_from_camera for name, one in known.cameras.items()}
        corrected = brought_to(self.room.corrected(tell), in_map)
        for frame in frames:
            if frame.name in corrected:
                record = self._record(frame, known, relocalizer, corrected)
                add(record.model_dump(mode="json"))
            tell(FINDING_S)

    def _record(
        self,
        frame: Frame,
        known: TrainingRecord,
        relocalizer: Relocalizer,
        corrected: Mapping[str, Floats],
    ) -> RoomRecord:
        record = RoomRecord(id=frame.name, fold=self.fold)
        try:
            # With the lenses that mapping found, as the map's own frames have.
            seen = known.observe(frame)
            rgbd = seen.rgbd()
            told = Told.by(lambda: relocalizer.locate(rgbd))
        except Exception as error:  # Whatever fails is told of its frame; others go on.
            return record.model_copy(update={"error": message_of(error)})
        found = {
            "given": told.answer(seen.given_pose),
            "corrected": told.answer(corrected[frame.name]),
        }
        return record.model_copy(update=found)
