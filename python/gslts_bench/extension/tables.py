"""Numbers and tables of extensions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from gslts_bench.extension.run import Record
from gslts_bench.runner import Benchmark
from gslts_bench.tables import Table


def summarize(records: Sequence[Record]) -> dict[str, Any]:
    """Return the numbers of all homes.

    Args:
        records: Records without error.

    Returns:
        JSON values by home.
    """
    return {record.home: record.as_json() for record in records}


def tabulate(found: Mapping[str, Any]) -> list[Table]:
    """Make all tables.

    Args:
        found: From `summarize`.
    """
    rows = []
    for home, numbers in found.items():
        for visit, frames in enumerate(numbers["frames"]):
            rows.append(
                [
                    f"{home}, visit {visit + 1}",
                    f"{numbers['placed'][visit]} of {frames}",
                    f"{numbers['psnr_db'][visit]:.2f} dB",
                    str(numbers["gaussians"][visit]),
                    f"{numbers['seconds'][visit]:.0f} s",
                    "",
                    "",
                ]
            )
        rows.append(
            [
                f"{home}, one map of all visits",
                "",
                f"{numbers['all_psnr_db']:.2f} dB",
                str(numbers["all_gaussians"]),
                f"{numbers['all_seconds']:.0f} s",
                "{:.1f} / {:.1f} cm".format(*numbers["shift_cm"]),
                "{:.2f}° / {:.2f}°".format(*numbers["turn_deg"]),
            ]
        )
    header = ["map", "frames placed", "test frames", "Gaussians", "time"]
    header += ["poses differ, median / maximum", "turned"]
    note = (
        "The first visit is mapped, each other one extends the map, on one core. Every 8th frame "
        "of the recording is in no visit: a test frame. Poses of test frames in the grown map are "
        "compared with those in the map of all visits."
    )
    return [Table("", header, rows, note)]


BENCHMARK = Benchmark("Extension", "extending", summarize, tabulate)
"""The benchmark of extensions."""
