"""Numbers and tables of updates by real visits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from gslts_bench.real.updates import UpdateRecord
from gslts_bench.runner import Benchmark
from gslts_bench.tables import Table, number


def summarize(records: Sequence[UpdateRecord]) -> dict[str, Any]:
    """Compute the numbers of each room and of all.

    Args:
        records: Records without error.

    Returns:
        JSON values.
    """
    rooms: dict[str, list[UpdateRecord]] = {}
    for record in records:
        rooms.setdefault(record.room, []).append(record)
    return {"rooms": {name: _numbers(own) for name, own in (rooms | {"all": [*records]}).items()}}


def _numbers(records: Sequence[UpdateRecord]) -> dict[str, Any]:
    return {
        "visits": len(records),
        "versions": sum(record.status == "updated" for record in records),
        "true": sum(record.true for record in records),
        "untrue": sum(record.untrue for record in records),
        "new_gain_db": _mean_gain_db([r.new_db for r in records if r.new_db is not None]),
        "elsewhere_gain_db": _mean_gain_db(
            [r.elsewhere_db for r in records if r.elsewhere_db is not None]
        ),
        "updated_new_gain_db": _mean_gain_db(
            [r.new_db for r in records if r.new_db is not None and r.status == "updated"]
        ),
    }


def _mean_gain_db(pairs: Sequence[tuple[float, float]]) -> float | None:
    return float(np.mean([after - before for before, after in pairs])) if pairs else None


def tabulate(summary: Mapping[str, Any]) -> list[Table]:
    """Make the table of all rooms.

    Args:
        summary: From `summarize`.
    """
    header = (
        "room",
        "visits",
        "versions",
        "changes in them",
        "of which untrue",
        "gain at new objects",
        "- in visits that updated",
        "gain elsewhere",
    )
    rows = [
        (
            name,
            str(numbers["visits"]),
            str(numbers["versions"]),
            str(numbers["true"] + numbers["untrue"]),
            str(numbers["untrue"]),
            number(numbers["new_gain_db"], 2, "dB"),
            number(numbers["updated_new_gain_db"], 2, "dB"),
            number(numbers["elsewhere_gain_db"], 2, "dB"),
        )
        for name, numbers in summary["rooms"].items()
    ]
    note = (
        "One frame of each visit is held out. Gain: its PSNR with the updated map minus that with "
        "the map of the first visit, in the boxes of new objects that two other frames show too, "
        "and away from all differences."
    )
    return [Table("Updates visit after visit", header, rows, note)]


BENCHMARK = Benchmark("Updates by real visits", "updating", summarize, tabulate)
"""The benchmark of updates by real visits."""
