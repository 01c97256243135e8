"""Plot of the accuracy of relocalization against its time."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import ScalarFormatter

from gslts_bench.relocalization.tables import ALL, of_knob
from gslts_bench.relocalization.variants import KNOBS, OURS, VARIANTS, knob_name

PANELS = {"mm": "median error of the position, mm", "deg": "median error of the rotation, °"}
"""Label of each panel by key of `scores`."""


def write_plot(found: Mapping[str, Any], title: str, path: Path) -> None:
    """Plot median errors against median time, as a PNG.

    Args:
        found: From `tables.summarize`.
        title: Title of the figure.
        path: File to write.
    """
    figure = Figure(figsize=(13, 6), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title, parse_math=False)
    for axes, (error, label) in zip(figure.subplots(1, 2), PANELS.items(), strict=True):
        _draw(axes, found, error)
        axes.set(xlabel="median time of a frame on one core, s", ylabel=label, xscale="log")
        for axis in (axes.xaxis.set_major_formatter, axes.xaxis.set_minor_formatter):
            axis(ScalarFormatter())
        axes.tick_params(axis="x", which="both", labelsize=8)
        axes.set_ylim(0, None)
        axes.grid(visible=True, which="both", alpha=0.25)
        if axes.has_data():
            axes.legend(fontsize=8)
    figure.savefig(path, dpi=110)


def _draw(axes: Axes, found: Mapping[str, Any], error: str) -> None:
    for number, (knob, marker) in enumerate(zip(KNOBS, "osD", strict=True)):
        color = f"C{number}"
        points = {
            value: (numbers["located"]["cpu_s"], numbers["located"][error])
            for value, numbers in of_knob(found, knob).items()
            if numbers["located"][error] is not None
        }
        if points:
            axes.plot(*zip(*points.values(), strict=True), f"{marker}-", color=color, label=knob)
        for value, point in points.items():
            if knob_name(knob, value) == OURS:
                continue  # A star marks it.
            axes.annotate(
                f"{value}",
                point,
                textcoords="offset points",
                xytext=(5, 4),
                fontsize=7,
                color=color,
            )
    default = found["variants"].get(OURS, {}).get("as mapped", {}).get(ALL)
    if default is not None and default["located"][error] is not None:
        words = ", ".join(f"{knob} {getattr(VARIANTS[OURS], knob)}" for knob in KNOBS)
        point = default["located"]["cpu_s"], default["located"][error]
        axes.plot(*point, "*", color="black", markersize=14, label=f"default: {words}")
