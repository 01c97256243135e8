"""The picture of how accurate change detection is in how much time."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator, ScalarFormatter

from gslts_bench.detection.variants import HALVINGS, TRADE

WANTED_MS, WANTED_SHARE = 60.0, 0.9
"""What is asked of the detector."""
TICKS = (1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0)
"""Of each decade."""
MARKERS, COLORS = "osD", ("C0", "C1", "C2", "C3")


def write_plot(summaries: Mapping[str, dict[str, Any]], title: str, path: Path) -> None:
    """Median time against the share of single changes with type and region right, as a PNG.

    Args:
        summaries: Those of all of `TRADE`, from `detect_tables.summary`.
        title: Stands above.
        path: Where to write.
    """
    figure = Figure(figsize=(9, 6), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title, parse_math=False)
    axes = figure.subplots()
    ways = list(dict.fromkeys(name.partition(", ")[2] for name in TRADE))
    for way, color in zip(ways, COLORS, strict=True):
        points = []
        for size, marker in zip(HALVINGS, MARKERS, strict=True):
            one = summaries[f"{size}, {way}"]
            right, of = one["single"]["right"]
            if of:
                points.append((one["ms"]["single"], 100 * right / of))
                axes.plot(*points[-1], marker, color=color, markersize=8)
        if points:
            axes.plot(*zip(*points, strict=True), "-", color=color, label=way)
    for size, marker in zip(HALVINGS, MARKERS, strict=True):
        axes.plot([], [], marker, color="0.4", label=f"{size} resolution")
    axes.axvline(WANTED_MS, color="0.7", linestyle=":", zorder=0)
    axes.axhline(100 * WANTED_SHARE, color="0.7", linestyle=":", zorder=0, label="wanted")
    axes.set(
        xlabel="median time of a frame on one core, ms",
        ylabel="single changes with type and region right, %",
        xscale="log",
    )
    axes.xaxis.set_major_locator(LogLocator(subs=TICKS))
    axes.xaxis.set_major_formatter(ScalarFormatter())
    axes.xaxis.set_minor_locator(NullLocator())
    axes.grid(visible=True, which="both", alpha=0.25)
    axes.legend(fontsize=8)
    figure.savefig(path, dpi=110)
