"""The results of navigation, as numbers and as tables in Markdown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gslts_bench.markdown import share, table
from gslts_bench.navigation.moved import NOT_UPDATED
from gslts_bench.navigation.run import Record

OVERALL = "overall"
FAR_M = 1.25
"""Five steps of 0.25 m: SAVN tells these episodes apart (L >= 5)."""


def summary(records: Sequence[Record]) -> dict[str, Any]:
    """Success rate and SPL by room type, for far starts, and by category, in values of JSON."""
    every = [one for one in records if one.error is None]
    moved = [one for one in every if "/moved_" in one.id]
    fine = [one for one in every if "/moved_" not in one.id]
    updated = [one for one in moved if one.status != NOT_UPDATED]
    relocations = [len({one.id.rpartition("/")[0] for one in group}) for group in (updated, moved)]
    rooms = list(dict.fromkeys(one.room_type for one in fine))
    categories = sorted({one.category for one in fine})
    statuses = sorted({one.status for one in fine})
    return {
        "rooms": {
            **{room: _of([one for one in fine if one.room_type == room]) for room in rooms},
            OVERALL: _of(fine),
        },
        "far": _of([one for one in fine if one.shortest_m >= FAR_M]),
        "categories": {
            name: _of([one for one in fine if one.category == name]) for name in categories
        },
        "moved": {**_of(updated), "relocations": relocations} if moved else None,
        "statuses": {name: sum(one.status == name for one in fine) for name in statuses},
    }


def printed(found: Mapping[str, Any]) -> str:
    """All tables."""
    rooms = {name.replace("_", " "): one for name, one in found["rooms"].items()}
    rooms[f"overall, shortest way of {FAR_M:g} m or more"] = found["far"]
    parts = ["## Navigation to objects"]
    statuses = ", ".join(f"{name} {count}" for name, count in found["statuses"].items())
    told = f"As the robot sees it: {statuses}."
    moved = found["moved"]
    if moved is not None:
        rooms["to objects that were moved, once the map is updated"] = moved
        updated = share(*moved["relocations"])
        told += f" Relocations detected in the first frame and updated: {updated}."
    parts += [_table("Room", rooms), told, "### By category"]
    return "\n\n".join([*parts, _table("Category", found["categories"])])


def _of(records: Sequence[Record]) -> dict[str, Any]:
    return {
        "episodes": len(records),
        "successes": sum(one.success for one in records),
        "spl": float(np.mean([one.spl for one in records])) if records else None,
        "shortest_m": float(np.mean([one.shortest_m for one in records])) if records else None,
    }


def _table(what: str, rows: Mapping[str, Mapping[str, Any]]) -> str:
    return table(
        (what, "Success rate", "SPL", "Mean shortest way"),
        (
            (
                name,
                share(one["successes"], one["episodes"]),
                "-" if one["spl"] is None else f"{100 * one['spl']:.1f}",
                "-" if one["shortest_m"] is None else f"{one['shortest_m']:.2f} m",
            )
            for name, one in rows.items()
        ),
    )
