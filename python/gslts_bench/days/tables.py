"""Tables of days: untrue versions, changes that the map shows, and events of objects."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

import numpy as np

from gslts.store.records import Event, ObjectEvent
from gslts_bench.days.events import is_untrue, score_events, true_events, was_found
from gslts_bench.days.run import Record
from gslts_bench.runner import Benchmark
from gslts_bench.tables import Table, share
from gslts_sim.task import Change

TARGETS = {"versions with something untrue": "2 %", "changes that the map shows": "85 %"}
"""Target by column."""
EVENT_TARGET = "90 %"
"""Target of precision and recall of events."""
UPDATES, TRACKS = "as updates found them", "as tracks tell them"
"""Events that are scored."""
Kind = TypeVar("Kind", ObjectEvent, Change)


def summarize(records: Sequence[Record]) -> dict[str, Any]:
    """Judge each day.

    Args:
        records: Records without error.

    Returns:
        JSON values by home: numbers of `rounds`, `versions`, `untrue` versions, `changes` and
        `shown` changes; `untrue_events` in words; and of events `scores`.
    """
    return {record.id.removesuffix("/day"): _judge(record) for record in records}


def _judge(record: Record) -> dict[str, Any]:
    happened: list[Change] = []
    untrue: list[Event] = []
    for past in record.rounds:
        happened += past.changes
        untrue += [event for event in past.events if is_untrue(event, happened)]
    events = [event for past in record.rounds for event in past.events]
    shown = 0
    for number, past in enumerate(record.rounds):
        since = [event for later in record.rounds[number:] for event in later.events]
        shown += sum(was_found(change, since) for change in past.changes)
    true = true_events(happened)
    reported: dict[str, Sequence[ObjectEvent]] = {UPDATES: events, TRACKS: record.tracks}
    return {
        "rounds": len(record.rounds),
        "versions": len({event.version for event in events}),
        "untrue": len({event.version for event in untrue}),
        "changes": len(happened),
        "shown": shown,
        "untrue_events": [_words(event) for event in untrue],
        "scores": {
            name: {
                "events": vars(score_events(of_history, true)),
                "moves": vars(score_events(_moves(of_history), _moves(true))),
            }
            for name, of_history in reported.items()
        },
    }


def _words(event: Event) -> str:
    ends = [
        "nowhere" if box is None else "({:.2f}, {:.2f}, {:.2f})".format(*np.mean(box, axis=0))
        for box in event.boxes
    ]
    return f"version {event.version}: {event.kind} of {event.type}, {ends[0]} to {ends[1]}"


def _moves(events: Sequence[Kind]) -> list[Kind]:
    return [event for event in events if event.kind == "relocation"]


def tabulate(found: Mapping[str, Any]) -> list[Table]:
    """Make the table of versions, and that of events.

    Args:
        found: From `summarize`.
    """
    return [_versions(found), _events(found)]


def _versions(found: Mapping[str, Any]) -> Table:
    header = ["home", "rounds", "versions", *TARGETS]
    counts = {
        name: [day[key] for key in ("rounds", "versions", "untrue", "shown", "changes")]
        for name, day in found.items()
    }
    counts["all"] = [sum(column) for column in zip(*counts.values(), strict=True)] or [0] * 5
    rows = [
        [name, str(rounds), str(versions), share(untrue, versions), share(shown, changes)]
        for name, (rounds, versions, untrue, shown, changes) in counts.items()
    ]
    lines = [f"{name}, {words}" for name, day in found.items() for words in day["untrue_events"]]
    note = f"Untrue, at the middle of boxes, m: {'; '.join(lines)}." if lines else ""
    return Table("Versions", header, [*rows, ["target", "", "", *TARGETS.values()]], note)


def _events(found: Mapping[str, Any]) -> Table:
    header = ["events", "precision", "recall", "precision of moves", "recall of moves"]
    rows = []
    for name in (UPDATES, TRACKS):
        cells = []
        for kind in ("events", "moves"):
            scores = [day["scores"][name][kind] for day in found.values()]
            right, reported, true = (
                sum(score[key] for score in scores) for key in ("right", "reported", "true")
            )
            cells += [share(right, reported), share(right, true)]
        rows.append([name, *cells])
    return Table("Events of objects", header, [*rows, ["target", *4 * [EVENT_TARGET]]])


BENCHMARK = Benchmark("Days of robots", "living", summarize, tabulate)
"""The benchmark of days."""
