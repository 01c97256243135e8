"""Plot of costs against the size of a map."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from gslts_bench.scale.run import STAGES


def write_plot(found: Mapping[str, Any], path: Path) -> None:
    """Plot the time of each stage and the memory against the number of Gaussians, as a PNG.

    Args:
        found: From `tables.summarize`.
        path: File to write.
    """
    figure = Figure(figsize=(13, 6), layout="constrained")
    FigureCanvasAgg(figure)
    times, memory = figure.subplots(1, 2)
    for home, records in found.items():
        sizes = [record["gaussians"] for record in records]
        for number, stage in enumerate(STAGES):
            seconds = [record["seconds"][stage] for record in records]
            label = f"{home}: {stage}"
            times.plot(sizes, seconds, "o-", color=f"C{number}", label=label)
        memory.plot(sizes, [record["memory_mib"] for record in records], "o-", label=home)
    times.set(xlabel="Gaussians", ylabel="CPU time, s", xscale="log", yscale="log")
    memory.set(xlabel="Gaussians", ylabel="memory of the process, MiB", xscale="log", yscale="log")
    for axes in (times, memory):
        axes.grid(visible=True, which="both", alpha=0.25)
        if axes.has_data():
            axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1, 0.5))
    figure.savefig(path, dpi=110)
