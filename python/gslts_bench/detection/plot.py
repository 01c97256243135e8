"""Plot of the accuracy of change detection against its time."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator, ScalarFormatter

from gslts_bench.detection.variants import HALVINGS, TRADE

TARGET_MS, TARGET_SHARE = 60.0, 0.9
"""Targets of the project for the detector, drawn as lines."""


def write_plot(detectors: Mapping[str, dict[str, Any]], title: str, path: Path) -> None:
    """Plot the share of single changes with type and region right against median time, as a PNG.

    Args:
        detectors: Numbers of all of `TRADE`, from `tables.summary`.
        title: Title of the figure.
        path: File to write.
    """
    figure = Figure(figsize=(9, 6), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title, parse_math=False)
    axes = figure.subplots()
    names = list(dict.fromkeys(name.partition(", ")[2] for name in TRADE))
    markers = dict(zip(HALVINGS, "osD", strict=True))
    for number, name in enumerate(names):
        points = []
        for size, marker in markers.items():
            found = detectors[f"{size}, {name}"]
            right, of = found["single"]["right"]
            if of:
                points.append((found["ms"]["single"], 100 * right / of))
                axes.plot(*points[-1], marker, color=f"C{number}", markersize=8)
        if points:
            axes.plot(*zip(*points, strict=True), "-", color=f"C{number}", label=name)
    for size, marker in markers.items():
        axes.plot([], [], marker, color="0.4", label=f"{size} resolution")
    axes.axvline(TARGET_MS, color="0.7", linestyle=":", zorder=0)
    axes.axhline(100 * TARGET_SHARE, color="0.7", linestyle=":", zorder=0, label="target")
    axes.set(
        xlabel="median time of a frame on one core, ms",
        ylabel="single changes with type and region right, %",
        xscale="log",
    )
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0)))
    axes.xaxis.set_major_formatter(ScalarFormatter())
    axes.xaxis.set_minor_locator(NullLocator())
    axes.grid(visible=True, which="both", alpha=0.25)
    axes.legend(fontsize=8)
    figure.savefig(path, dpi=110)
