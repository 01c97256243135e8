"""Plot of the speed of rendering against its accuracy."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import ScalarFormatter

from gslts_bench.tradeoff.rendering import Point


def write_plot(points: Sequence[Point], title: str, path: Path) -> None:
    """Plot PSNR against time, and the error of gradients against time with them, as a PNG.

    Args:
        points: From `measure`; the default is the first.
        title: Title of the figure.
        path: File to write.
    """
    figure = Figure(figsize=(13, 6), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title, parse_math=False)  # A path may hold dollars.
    image, gradient = figure.subplots(1, 2)
    _draw(image, points, [p.forward_ms for p in points], [p.psnr_db for p in points])
    front = sorted((p for p in points if p.on_front), key=lambda p: p.forward_ms)
    image.step(
        [p.forward_ms for p in front],
        [p.psnr_db for p in front],
        where="post",
        color="0.6",
        zorder=0,
        label="Pareto front",
    )
    image.set(xlabel="image, ms", ylabel="PSNR against the exact image, dB")
    image.legend(loc="lower right", fontsize=8)
    _draw(
        gradient,
        points,
        [p.forward_backward_ms for p in points],
        [p.gradient_error for p in points],
    )
    gradient.set(xlabel="image and gradients, ms", ylabel="relative error of the gradients")
    gradient.set_yscale("log")
    gradient.invert_yaxis()
    figure.savefig(path, dpi=110)


def _draw(axes: Axes, points: Sequence[Point], x: Sequence[float], y: Sequence[float]) -> None:
    knobs = list(dict.fromkeys(point.knob for point in points[1:]))
    for number, knob in enumerate(knobs):
        of_knob = [i for i, point in enumerate(points) if point.knob == knob]
        axes.plot(
            [x[i] for i in of_knob],
            [y[i] for i in of_knob],
            "osD^vP*X"[number % 8],
            color=f"C{number}",
            label=knob,
        )
        for i in of_knob:
            axes.annotate(
                points[i].value,
                (x[i], y[i]),
                textcoords="offset points",
                xytext=(5, 4),
                fontsize=7,
                color=f"C{number}",
            )
    axes.plot(x[0], y[0], "*", color="black", markersize=14, label="default")
    axes.set_xscale("log")
    axes.xaxis.set_major_formatter(ScalarFormatter())
    axes.xaxis.set_minor_formatter(ScalarFormatter())
    axes.tick_params(axis="x", which="both", labelsize=8)
    axes.grid(visible=True, which="both", alpha=0.25)
