"""Relocalization in a recorded room: frames held out of a map are localized in it.

They are judged by the poses of the data set, and by those that mapping corrects them to: the first
err by centimetres, the second by the difference of two maps of the same room.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

from gslts.datasets import Frame
from gslts.fleet.jobs import Add
from gslts.localization.relocalizer import Relocalizer
from gslts.mapping.evaluation.held_out import TrainingRecord
from gslts.types import Floats
from gslts_bench.relocalization.room import FOLDS, RecordedRoom, RoomFold, transfer
from gslts_bench.relocalization.run import Relocalizers
from gslts_bench.relocalization.score import Answer, TimedAnswer
from gslts_bench.relocalization.variants import OURS
from gslts_bench.runner import BenchRecord, BenchUnit, attempt


class RoomRecord(BenchRecord):
    """Result of one frame, whose name is the id.

    Attributes:
        fold: Fold of the map that was made without it.
        given: Answer judged by the pose of the data set.
        corrected: Answer judged by the pose that mapping corrects it to.
    """

    fold: int
    given: Answer | None = None
    corrected: Answer | None = None


@dataclass(frozen=True)
class FoldUnit(BenchUnit[RoomRecord, RoomFold]):
    """Work on one fold of a room."""

    topic = "relocalize"
    record = RoomRecord

    @property
    def count(self) -> int:
        """Number of results when all is done."""
        return len(self.bench.frames)

    def run(self, done: frozenset[str], add: Add) -> None:
        """Localize the frames that are missing, but for those that mapping cannot use.

        Args:
            done: Ids of the results of earlier runs.
            add: Receives each new result.
        """
        frames = [frame for frame in self.bench.frames if frame.name not in done]
        if not frames:
            return
        room, fold = self.bench.room, self.bench.fold
        folder = self.bench.map()
        known, relocalizer = TrainingRecord.read(folder), Relocalizers(folder).of(OURS)
        in_map = {name: camera.world_from_camera for name, camera in known.cameras.items()}
        corrected = transfer(room.corrected_poses(), in_map)
        for frame in frames:
            if frame.name in corrected:
                record = RoomRecord(id=frame.name, fold=fold)
                ask = partial(_localize, frame, known, relocalizer, corrected)
                add(attempt(record, ask).model_dump(mode="json"))


def units_of(room: RecordedRoom, folds: Sequence[int]) -> list[FoldUnit]:
    """List the work in a room.

    Args:
        room: The room.
        folds: Numbers of folds; empty for all.

    Raises:
        ValueError: A fold does not exist.
    """
    if not set(folds) <= set(range(FOLDS)):
        got = ", ".join(map(str, folds))
        raise ValueError(f"folds: expected some of 0 to {FOLDS - 1}, got {got}")
    return [FoldUnit(RoomFold(room, fold)) for fold in sorted(set(folds)) or range(FOLDS)]


def _localize(
    frame: Frame, known: TrainingRecord, relocalizer: Relocalizer, corrected: Mapping[str, Floats]
) -> dict[str, Any]:
    """Localize a frame and judge the answer; return fields of `RoomRecord`."""
    observation = known.observe(frame)  # With the lenses that mapping found.
    rgbd = observation.rgbd()
    answer = TimedAnswer.of(lambda: relocalizer.localize(rgbd))
    return {
        "given": answer.judge(observation.given_pose),
        "corrected": answer.judge(corrected[frame.name]),
    }
