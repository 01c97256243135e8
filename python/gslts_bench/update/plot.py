"""Plot of PSNR against iterations of the refinement (GS-LTS, figure 5)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from gslts_bench.update.run import MARKS


def write_plot(curves: Mapping[str, Mapping[str, Sequence[float]]], title: str, path: Path) -> None:
    """Plot PSNR of near and far viewpoints against iterations, as a PNG.

    Args:
        curves: Curve of each method, from `tables.summarize`.
        title: Title of the figure.
        path: File to write.
    """
    figure = Figure(figsize=(8, 5), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title, parse_math=False)
    axes = figure.subplots()
    for (name, curve), color in zip(curves.items(), ("C0", "C3"), strict=True):
        for number, (view, style) in enumerate({"near": "-", "far": "--"}.items()):
            marks = [mark for mark in MARKS if str(mark) in curve]
            heights = [curve[str(mark)][number] for mark in marks]
            axes.plot(marks, heights, style, marker="o", color=color, label=f"{name}, {view}")
    axes.set(xlabel="iterations", ylabel="PSNR of the crops, dB", xscale="symlog")
    axes.set_xticks(MARKS, [str(mark) for mark in MARKS])
    axes.grid(visible=True, alpha=0.25)
    axes.legend(fontsize=8)
    figure.savefig(path, dpi=110)
