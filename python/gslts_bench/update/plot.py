"""The picture of PSNR against iterations of the refinement (GS-LTS, figure 5)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from gslts_bench.update.run import MARKS

STYLES = {"near": "-", "far": "--"}


def write_plot(curves: Mapping[str, Mapping[str, Sequence[float]]], title: str, path: Path) -> None:
    """PSNR of near and far views after some iterations, as a PNG.

    Args:
        curves: Of each method, from `update_tables.summary`.
        title: Stands above.
        path: Where to write.
    """
    figure = Figure(figsize=(8, 5), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title, parse_math=False)
    axes = figure.subplots()
    for (name, one), color in zip(curves.items(), ("C0", "C3"), strict=True):
        for number, (view, style) in enumerate(STYLES.items()):
            marks = [mark for mark in MARKS if str(mark) in one]
            heights = [one[str(mark)][number] for mark in marks]
            axes.plot(marks, heights, style, marker="o", color=color, label=f"{name}, {view}")
    axes.set(xlabel="iterations", ylabel="PSNR of the crops, dB", xscale="symlog")
    axes.set_xticks(MARKS, [str(mark) for mark in MARKS])
    axes.grid(visible=True, alpha=0.25)
    axes.legend(fontsize=8)
    figure.savefig(path, dpi=110)
