"""The benchmark of relocalization: simulated homes, or a recorded room, to numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from gslts import __version__
from gslts_bench.homes import BenchHome
from gslts_bench.relocalization.fold import FoldUnit, RoomRecord
from gslts_bench.relocalization.room import FOLDS, RecordedRoom
from gslts_bench.relocalization.room_tables import room_printed, room_summary
from gslts_bench.relocalization.run import Record, RelocalizeUnit
from gslts_bench.relocalization.tables import counted, printed, summary
from gslts_bench.work import run_for_records

Unit = RelocalizeUnit | FoldUnit


@dataclass(frozen=True, eq=False)
class Outcome:
    """What the benchmark found.

    Attributes:
        records: One for each frame of a home and variant.
        of_room: One for each frame of a recorded room.
        failed: Homes and folds in which nothing could be asked, and why.
    """

    records: tuple[Record, ...]
    of_room: tuple[RoomRecord, ...]
    failed: dict[str, str]

    @property
    def errors(self) -> dict[str, str]:
        """Frames, homes and folds that errored, and why."""
        records: list[Record | RoomRecord] = [*self.records, *self.of_room]
        return {**{one.id: one.error for one in records if one.error is not None}, **self.failed}


def units_of(
    homes: Sequence[BenchHome], views: int, *, ablation: bool, trade: bool
) -> list[RelocalizeUnit]:
    """The work in homes; see `RelocalizeUnit`."""
    return [RelocalizeUnit(home, views, ablation, trade) for home in homes]


def folds_of(room: RecordedRoom, folds: Sequence[int]) -> list[FoldUnit]:
    """The work in a room; of all folds if none is named.

    Raises:
        ValueError: There is no such fold.
    """
    if not set(folds) <= set(range(FOLDS)):
        got = ", ".join(map(str, folds))
        raise ValueError(f"folds: expected some of 0 to {FOLDS - 1}, got {got}")
    return [FoldUnit(room, fold) for fold in sorted(set(folds)) or range(FOLDS)]


def measure(units: Sequence[Unit], jobs: int, bar: Any) -> Outcome:
    """Does what was not done yet; see `run_for_records`."""
    records: list[Record | RoomRecord]
    records, failed = run_for_records(units, jobs, bar)
    of_homes = tuple(one for one in records if isinstance(one, Record))
    of_room = tuple(one for one in records if isinstance(one, RoomRecord))
    return Outcome(of_homes, of_room, failed)


def told(units: Sequence[Unit], outcome: Outcome) -> dict[str, Any]:
    """Everything, in values of JSON."""
    records: list[Record | RoomRecord] = [*outcome.records, *outcome.of_room]
    return {
        "gslts": __version__,
        "maps": {
            unit.name: {"made_of": unit.mapped_of, "results": unit.results.name} for unit in units
        },
        "summary": summary(outcome.records),
        "room": room_summary(outcome.of_room),
        "errors": outcome.errors,
        "records": [record.model_dump(mode="json") for record in records],
    }


def tables(outcome: Outcome) -> str:
    """All there are, in Markdown."""
    parts = []
    if outcome.records:
        parts += [counted(outcome.records), printed(summary(outcome.records))]
    if outcome.of_room:
        parts += [room_printed(room_summary(outcome.of_room))]
    return "\n\n".join(parts)
