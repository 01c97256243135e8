"""Plot of the accuracy of maps against time and number of Gaussians."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import EngFormatter, LogLocator, NullFormatter, NullLocator

from gslts_bench.tradeoff.mapping import MappingPoint

POSES = {
    "refined_psnr_db": ("poses refined", "o", "C0"),
    "by_neighbours_psnr_db": ("poses corrected by neighbours", "s", "C1"),
    "given_psnr_db": ("poses as given", "D", "C2"),
}
"""Name, marker and colour of each field of a point."""


def write_plot(points: Sequence[MappingPoint], title: str, path: Path) -> None:
    """Plot PSNR of test frames against time and number of Gaussians, as a PNG.

    Args:
        points: Points of all kinds; the map itself once.
        title: Title of the figure.
        path: File to write.
    """
    figure = Figure(figsize=(13, 6), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title, parse_math=False)  # A path may hold dollars.
    of_time, of_count = figure.subplots(1, 2)
    itself = next(point for point in points if point.kind == "map")
    timed = [point for point in points if point.kind == "time"]
    sized = [point for point in points if point.kind == "gaussians"]

    seconds = [point.seconds or 0.0 for point in timed]
    for field, (label, marker, color) in POSES.items():
        y_db = [getattr(point, field) for point in timed]
        if None not in y_db:
            of_time.plot(seconds, y_db, f"{marker}-", color=color, label=label)
        of_map = getattr(itself, field)
        if itself.seconds is not None and of_map is not None:
            _star(of_time, [itself.seconds], [of_map], color)
    sizes = [EngFormatter(places=1, sep="")(point.gaussians) for point in timed]
    _note(of_time, seconds, [point.refined_psnr_db for point in timed], sizes)
    if itself.seconds is not None:
        _star(of_time, [], [], "white", "the map, as it is")
    of_time.set(
        title="maps made from scratch, and their Gaussians",
        xlabel="time to make the map, s",
        ylabel="PSNR of test frames, dB",
    )

    _, marker, color = POSES["refined_psnr_db"]
    y_db = [point.refined_psnr_db for point in sized]
    counts = [point.gaussians for point in sized]
    of_count.plot(
        counts,
        y_db,
        f"{marker}-",
        color=color,
        label=f"{sized[0].steps} steps later, poses refined",
    )
    _note(of_count, counts, y_db, [point.name for point in sized])
    _star(of_count, [itself.gaussians], [itself.refined_psnr_db], color)
    _star(of_count, [], [], "white", "the map, as it is")
    of_count.set(
        title="the map, refined with fewer or more Gaussians",
        xlabel="Gaussians",
        ylabel="PSNR of test frames, dB",
    )

    for axes in (of_time, of_count):
        axes.set_xscale("log")
        _mark_decades(axes.xaxis)
        axes.margins(x=0.16, y=0.1)
        axes.grid(visible=True, which="major", alpha=0.25)
        below = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.09), "ncols": 4}
        axes.legend(**below, frameon=False, fontsize=8)
    figure.savefig(path, dpi=110)


def _star(
    axes: Axes, x: Sequence[float], y: Sequence[float], color: str, label: str | None = None
) -> None:
    """Mark the map, or only its entry in the legend."""
    axes.plot(x, y, "*", color=color, markeredgecolor="black", markersize=14, label=label)


def _note(axes: Axes, x: Sequence[float], y: Sequence[float], words: Sequence[str]) -> None:
    """Write words above the points of a line, on the side where it does not come from above."""
    for i, text in enumerate(words):
        side = 1 if i > 0 and y[i] < y[i - 1] else -1
        axes.annotate(
            text,
            (x[i], y[i]),
            textcoords="offset points",
            xytext=(6 * side, 5),
            ha="left" if side > 0 else "right",
            fontsize=8,
            color="0.3",
        )


def _mark_decades(axis: Axis) -> None:
    axis.set_major_locator(LogLocator(subs=(1.0, 1.5, 2.0, 3.0, 5.0, 7.0)))
    axis.set_major_formatter(EngFormatter(sep=""))
    axis.set_minor_locator(NullLocator())
    axis.set_minor_formatter(NullFormatter())
    axis.set_tick_params(labelsize=8)
