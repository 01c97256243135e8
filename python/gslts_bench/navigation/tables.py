"""Numbers and tables of navigation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gslts_bench.navigation.relocated import NOT_UPDATED
from gslts_bench.navigation.run import Record
from gslts_bench.runner import Benchmark
from gslts_bench.tables import Table, number, share

FAR_M = 1.25
"""Shortest path of the episodes that SAVN reports separately (L >= 5): five steps of 0.25 m."""


def summarize(records: Sequence[Record]) -> dict[str, Any]:
    """Compute success rate and SPL by room type, for far starts, and by category.

    Args:
        records: Records without error.

    Returns:
        JSON values.
    """
    moved = [record for record in records if record.is_relocated]
    own = [record for record in records if not record.is_relocated]
    updated = [record for record in moved if record.status != NOT_UPDATED]
    relocations = [
        len({record.id.rpartition("/")[0] for record in group}) for group in (updated, moved)
    ]
    rooms = list(dict.fromkeys(record.room_type for record in own))
    categories = sorted({record.category for record in own})
    statuses = sorted({record.status for record in own})
    return {
        "rooms": {
            **{
                room: _numbers([record for record in own if record.room_type == room])
                for room in rooms
            },
            "overall": _numbers(own),
        },
        "far": _numbers([record for record in own if record.shortest_m >= FAR_M]),
        "categories": {
            name: _numbers([record for record in own if record.category == name])
            for name in categories
        },
        "moved": {**_numbers(updated), "relocations": relocations} if moved else None,
        "statuses": {name: sum(record.status == name for record in own) for name in statuses},
    }


def tabulate(found: Mapping[str, Any]) -> list[Table]:
    """Make all tables.

    Args:
        found: From `summarize`.
    """
    rooms = {name.replace("_", " "): numbers for name, numbers in found["rooms"].items()}
    rooms[f"overall, shortest path of {FAR_M:g} m or more"] = found["far"]
    statuses = ", ".join(f"{name} {count}" for name, count in found["statuses"].items())
    note = f"As the robot knows it: {statuses}."
    if found["moved"] is not None:
        rooms["to objects that were relocated, once the map is updated"] = found["moved"]
        updated = share(*found["moved"]["relocations"])
        note += f" Relocations detected in the first frame and updated: {updated}."
    return [
        _table("", "Room", rooms, note),
        _table("By category", "Category", found["categories"]),
    ]


BENCHMARK = Benchmark("Navigation to objects", "navigating", summarize, tabulate)
"""The benchmark of navigation."""


def _numbers(records: Sequence[Record]) -> dict[str, Any]:
    return {
        "episodes": len(records),
        "successes": sum(record.success for record in records),
        "spl": float(np.mean([record.spl for record in records])) if records else None,
        "shortest_m": float(np.mean([record.shortest_m for record in records]))
        if records
        else None,
    }


def _table(title: str, first: str, rows: Mapping[str, Mapping[str, Any]], note: str = "") -> Table:
    cells = [
        (
            name,
            share(numbers["successes"], numbers["episodes"]),
            "-" if numbers["spl"] is None else f"{100 * numbers['spl']:.1f}",
            number(numbers["shortest_m"], 2, "m"),
        )
        for name, numbers in rows.items()
    ]
    return Table(title, (first, "Success rate", "SPL", "Mean shortest path"), cells, note)
