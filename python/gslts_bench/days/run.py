"""Benchmark of days: a robot goes its rounds while objects come, go and move, and keeps the map."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from gslts.fleet.jobs import Add
from gslts.keeper.config import KeeperConfig
from gslts.keeper.keeper import MapKeeper
from gslts.semantics.add_semantics import add_semantics
from gslts.store.history import open_history
from gslts.store.records import Event, TrackEvent
from gslts.update.config import UpdateConfig
from gslts_bench.homes import BenchHome
from gslts_bench.runner import BenchRecord, BenchUnit
from gslts_sim.day import Day, make_day
from gslts_sim.strict_model import STRICT
from gslts_sim.task import Change


class Round(BaseModel):
    """Round of a robot.

    Attributes:
        changes: What happened before it.
        events: What the versions of the round show, in the order of the versions.
    """

    model_config = STRICT

    changes: tuple[Change, ...]
    events: tuple[Event, ...]


class Record(BenchRecord):
    """A day of a home; the id is the home and `day`.

    Attributes:
        rounds: Its rounds.
        tracks: Events of all objects, put together over the rounds.
    """

    rounds: tuple[Round, ...] = ()
    tracks: tuple[TrackEvent, ...] = ()


@dataclass(frozen=True)
class DaysUnit(BenchUnit[Record, BenchHome]):
    """Work on one home.

    Attributes:
        changes: Number of changes.
    """

    topic = "days"
    record = Record

    changes: int

    @property
    def settings(self) -> dict[str, Any]:
        """JSON values that decide the results besides map and code."""
        return {"changes": self.changes}

    @property
    def count(self) -> int:
        """Number of results when all is done."""
        return 1

    @property
    def folder(self) -> Path:
        """Folder of the map that the robot keeps."""
        assert self.results is not None
        return self.results.with_suffix("")

    def run(self, done: frozenset[str], add: Add) -> None:
        """Keep the map of the home through its day, and record what its history shows.

        Args:
            done: Ids of the results of earlier runs.
            add: Receives the result.
        """
        case = f"{self.name}/day"
        if case in done:
            return
        first = self.bench.map()
        shutil.rmtree(self.folder, ignore_errors=True)  # Left by a run that was stopped.
        shutil.copytree(first, self.folder)
        add_semantics(self.folder, self.bench.recording(), threads=1)
        rounds = self._go_rounds(self._day())
        with open_history(self.folder) as history:
            tracks = [event for track in history.tracks() for event in track.events]
        add(Record(id=case, rounds=rounds, tracks=tuple(tracks)).model_dump(mode="json"))

    def _day(self) -> Day:
        """Return the changes, the first of which starts from the state of the map."""
        start, bench = self.bench.tasks(1)[0], self.bench
        return make_day(start.home, bench.load(), bench.setup.setting, bench.seed, self.changes)

    def _go_rounds(self, day: Day) -> tuple[Round, ...]:
        home = self.bench.load()
        rounds: list[Round] = []
        with MapKeeper(self.folder, KeeperConfig(update=UpdateConfig(threads=1))) as keeper:
            for number, happened in enumerate(day.rounds, start=1):
                keeper.go_round(day.robot(home, number))
                earlier = sum(len(past.events) for past in rounds)
                with open_history(self.folder) as history:
                    events = history.events()[earlier:]
                changes = tuple(event.change for event in happened)
                rounds.append(Round(changes=changes, events=tuple(events)))
        return tuple(rounds)
