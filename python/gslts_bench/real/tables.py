"""Numbers and tables of change detection on real visits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from gslts_bench.real.boxes import JUDGED
from gslts_bench.real.run import VisitRecord
from gslts_bench.real.visit_score import CONFIRMATION
from gslts_bench.runner import Benchmark
from gslts_bench.tables import Table, mean, share


def summarize(records: Sequence[VisitRecord]) -> dict[str, Any]:
    """Compute the numbers of each room and of all, of single frames and of whole visits.

    Args:
        records: Records without error.

    Returns:
        JSON values.
    """
    rooms = list(dict.fromkeys(record.room for record in records))
    return {
        part: {
            **{name: _numbers([r for r in own if r.room == name]) for name in rooms},
            "all": _numbers(own),
        }
        for part in TITLES
        if (own := [record for record in records if record.part == part])
    }


def _numbers(records: Sequence[VisitRecord]) -> dict[str, Any]:
    objects = [marked for record in records for marked in record.objects]
    return {
        "records": len(records),
        "frames": sum(record.frames for record in records),
        "unreliable": sum(record.unreliable for record in records),
        "others": sum(len(record.others) for record in records),
        **{
            kind: [
                sum(marked.found for marked in objects if marked.kind == kind),
                sum(marked.kind == kind for marked in objects),
            ]
            for kind in JUDGED
        },
    }


def tabulate(summary: Mapping[str, Any]) -> list[Table]:
    """Make the tables of all rooms.

    Args:
        summary: From `summarize`.
    """
    return [_table(part, rooms) for part, rooms in summary.items()]


def _table(part: str, rooms: Mapping[str, Any]) -> Table:
    header = (
        "room",
        f"{part}s",
        "new found",
        "missing found",
        f"other reports a {part}",
        "frames unreliable",
        "nudged reported as a shift",
    )
    rows = [
        (
            name,
            str(numbers["records"]),
            share(*numbers["new"]),
            share(*numbers["missing"]),
            mean(numbers["others"], numbers["records"]),
            share(numbers["unreliable"], numbers["frames"]),
            share(*numbers["nudged"]),
        )
        for name, numbers in rooms.items()
    ]
    return Table(TITLES[part], header, rows, NOTES[part])


TITLES = {
    "frame": "Single frames of later visits against the map of the first one",
    "visit": "All frames of a visit with `ChangeMonitor`",
}
"""Heading of the table of each part."""
NOTES = {
    "frame": "Found: the boxes of a report and of the object have an IoU of at least 0.25.",
    "visit": "The frames of a visit must give a change a confidence of "
    f"{CONFIRMATION.confidence} together. An object counts once in each visit.",
}
"""Sentence below each table."""
BENCHMARK = Benchmark("Real visits", "comparing", summarize, tabulate)
"""The benchmark of change detection on real visits."""
