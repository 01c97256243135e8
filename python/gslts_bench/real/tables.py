"""Numbers and tables of change detection on real visits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from gslts_bench.real.run import VisitRecord
from gslts_bench.runner import Benchmark
from gslts_bench.tables import Table, mean, share


def summarize(records: Sequence[VisitRecord]) -> dict[str, Any]:
    """Compute the numbers of each room and of all.

    Args:
        records: Records without error.

    Returns:
        JSON values.
    """
    rooms: dict[str, list[VisitRecord]] = {}
    for record in records:
        rooms.setdefault(record.room, []).append(record)
    numbers = {name: _numbers(own) for name, own in rooms.items()}
    return {"rooms": {**numbers, "all": _numbers(records)}}


def _numbers(records: Sequence[VisitRecord]) -> dict[str, Any]:
    objects = [marked for record in records for marked in record.objects]
    return {
        "frames": len(records),
        "unreliable": sum(record.unreliable is not None for record in records),
        "others": sum(len(record.others) for record in records),
        **{
            kind: [
                sum(marked.found for marked in objects if marked.kind == kind),
                sum(marked.kind == kind for marked in objects),
            ]
            for kind in ("new", "missing")
        },
    }


def tabulate(summary: Mapping[str, Any]) -> list[Table]:
    """Make the table of all rooms.

    Args:
        summary: From `summarize`.
    """
    header = ("room", "frames", "new found", "missing found", "other reports a frame", "unreliable")
    rows = [
        (
            name,
            str(numbers["frames"]),
            share(*numbers["new"]),
            share(*numbers["missing"]),
            mean(numbers["others"], numbers["frames"]),
            share(numbers["unreliable"], numbers["frames"]),
        )
        for name, numbers in summary["rooms"].items()
    ]
    title = "Single frames of later visits against the map of the first one"
    note = "Found: the boxes of a reported region and of the object have an IoU of at least 0.25."
    return [Table(title, header, rows, note)]


BENCHMARK = Benchmark("Real visits", "comparing", summarize, tabulate)
"""The benchmark of change detection on real visits."""
