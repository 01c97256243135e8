"""Numbers and tables of costs by the size of a map."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from gslts_bench.runner import Benchmark
from gslts_bench.scale.run import STAGES, Record
from gslts_bench.tables import Table

NOTE = (
    "CPU time of one thread, and the maximum memory of the process; in brackets the factor over "
    "the smallest map. `open` reads the map, `index` makes a detector for it, `first detect` also "
    "renders the training cameras that see what changed. `words` prepares queries, and reads all "
    "of the map; `query` finds one word in each room. `update` is all after the robot's tour; "
    "`commit` includes landmarks and the image."
)
"""Sentence below a table."""


def summarize(records: Sequence[Record]) -> dict[str, Any]:
    """Return the records of each home, the smallest map first.

    Args:
        records: Records without error.

    Returns:
        JSON values by home.
    """
    homes: dict[str, list[dict[str, Any]]] = {}
    for record in sorted(records, key=lambda record: record.gaussians):
        homes.setdefault(record.home, []).append(record.as_json())
    return homes


def tabulate(found: Mapping[str, Any]) -> list[Table]:
    """Make all tables.

    Args:
        found: From `summarize`.
    """
    return [
        Table(
            home,
            ["rooms", "Gaussians", *(f"{stage}, ms" for stage in STAGES), "memory, MiB"],
            [_row(record, records[0]) for record in records],
            NOTE,
        )
        for home, records in found.items()
    ]


def _row(record: Mapping[str, Any], first: Mapping[str, Any]) -> list[str]:
    times = [
        _cell(1000 * record["seconds"][stage], 1000 * first["seconds"][stage]) for stage in STAGES
    ]
    memory = _cell(record["memory_mib"], first["memory_mib"])
    return [str(record["rooms"]), f"{record['gaussians']:,}", *times, memory]


def _cell(value: float, smallest: float) -> str:
    return f"{value:.0f} ({value / smallest:.2f})" if smallest > 0 else f"{value:.0f}"


BENCHMARK = Benchmark("Scale", "measuring", summarize, tabulate)
"""The benchmark of scale."""
