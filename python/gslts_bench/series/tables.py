"""Table and plot of many changes in a row."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from gslts_bench.runner import Benchmark
from gslts_bench.series.run import BEFORE, MAPS, REBUILT, UPDATED, Record
from gslts_bench.tables import Table, share

GAIN, GROWTH = "PSNR, updated minus rebuilt", "Gaussians, updated against before"
"""Rows of the table that have a target."""
TARGETS = {GAIN: "-0.5 dB", GROWTH: "+5 %"}
"""Target by row."""


def summarize(records: Sequence[Record]) -> dict[str, Any]:
    """Collect the steps and the end of each home.

    Args:
        records: Records without error.

    Returns:
        JSON values: `steps` and, of homes that came to it, `end` by name of the home.
    """
    homes: dict[str, Any] = {}
    for record in records:
        home = homes.setdefault(record.id.partition("/")[0], {"steps": [], "end": None})
        if record.end is not None:
            home["end"] = record.end.model_dump(mode="json")
        if record.step is not None:
            home["steps"].append(record.step.model_dump(mode="json"))
    return homes


def tabulate(found: Mapping[str, Any]) -> list[Table]:
    """Make a table with a column for each home that came to its end.

    Args:
        found: From `summarize`.
    """
    ended = {name: home for name, home in found.items() if home["end"] is not None}
    columns = [_column(home["steps"], home["end"]) for home in ended.values()]
    if not columns:
        return [Table("", (), (), "No home came to its end.")]
    header = ["", *(f"{name}, {len(home['steps'])} changes" for name, home in ended.items())]
    rows = [[row, *(column[row] for column in columns), TARGETS.get(row, "")] for row in columns[0]]
    return [Table("", [*header, "target"], rows)]


BENCHMARK = Benchmark("Many changes in a row", "updating", summarize, tabulate)
"""The benchmark of many changes in a row."""


def _column(steps: Sequence[Mapping[str, Any]], end: Mapping[str, Any]) -> dict[str, str]:
    idle = sum(step["changes"] == 0 or step["rejected"] is not None for step in steps)
    psnr_db, gaussians = end["psnr_db"], end["gaussians"]
    growth = gaussians[UPDATED] / gaussians[BEFORE] - 1
    return {
        "detected in the first frame": share(sum(step["detected"] for step in steps), len(steps)),
        "left without an update": share(idle, len(steps)),
        "edit and refinement, median": f"{np.median([step['seconds'] for step in steps]):.1f} s",
        **{f"PSNR of new viewpoints, {name}": f"{psnr_db[name]:.2f} dB" for name in MAPS},
        GAIN: f"{psnr_db[UPDATED] - psnr_db[REBUILT]:+.2f} dB",
        **{f"Gaussians, {name}": str(gaussians[name]) for name in MAPS},
        GROWTH: f"{100 * growth:+.1f} %",
    }


def write_plot(found: Mapping[str, Any], path: Path) -> None:
    """Plot PSNR and the number of Gaussians after each change, as a PNG.

    Args:
        found: From `summarize`.
        path: File to write.
    """
    figure = Figure(figsize=(8, 6), layout="constrained")
    FigureCanvasAgg(figure)
    upper, lower = figure.subplots(2, sharex=True)
    for row, (name, home) in enumerate(found.items()):
        color, steps, end = f"C{row}", home["steps"], home["end"]
        measured = [
            (k, step["psnr_db"]) for k, step in enumerate(steps, start=1) if step["psnr_db"]
        ]
        numbers, psnrs_db = [k for k, _ in measured], [psnr_db for _, psnr_db in measured]
        upper.plot(numbers, psnrs_db, "-o", color=color, label=f"{name}, updated")
        counts = [step["gaussians"] for step in steps]
        lower.plot(range(1, len(steps) + 1), counts, "-", color=color, label=f"{name}, updated")
        if end is None:
            continue
        for known, marker in ((BEFORE, "x"), (REBUILT, "*")):
            label = f"{name}, {known}"
            upper.plot(len(steps), end["psnr_db"][known], marker, color=color, label=label)
            lower.plot(len(steps), end["gaussians"][known], marker, color=color, label=label)
    upper.set(ylabel="PSNR of new viewpoints, dB")
    lower.set(xlabel="changes", ylabel="Gaussians")
    for axes in (upper, lower):
        axes.grid(visible=True, alpha=0.25)
        axes.legend(fontsize=8)
    figure.savefig(path, dpi=110)
