"""A table and a picture of many changes in a row."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from gslts_bench.markdown import share, table
from gslts_bench.series.benchmark import ANEW, BEFORE, MAPS, UPDATED, End, Step

GAIN, GROWTH = "PSNR, updated against built anew", "Gaussians, updated against before"
WANTED = {GAIN: "-0.5 dB", GROWTH: "+10 %"}


def printed(steps: Mapping[str, Sequence[Step]], ends: Mapping[str, End]) -> str:
    """A table in Markdown with a column for each home that came to its end."""
    columns = []
    for name, end in ends.items():
        own = steps[name]
        idle = sum(one.changes == 0 or one.rejected is not None for one in own)
        gain_db = end.psnr_db[UPDATED] - end.psnr_db[ANEW]
        growth = end.gaussians[UPDATED] / end.gaussians[BEFORE] - 1
        columns.append(
            {
                "detected in the first frame": share(sum(one.detected for one in own), len(own)),
                "left without an update": share(idle, len(own)),
                "edit and refinement, median": f"{np.median([one.seconds for one in own]):.1f} s",
                **{f"PSNR of fresh views, {map_}": f"{end.psnr_db[map_]:.2f} dB" for map_ in MAPS},
                GAIN: f"{gain_db:+.2f} dB",
                **{f"Gaussians, {map_}": str(end.gaussians[map_]) for map_ in MAPS},
                GROWTH: f"{100 * growth:+.1f} %",
            }
        )
    if not columns:
        return "no home came to its end"
    header = ["", *(f"{name}, {len(steps[name])} changes" for name in ends), "wanted"]
    rows = [[row, *(column[row] for column in columns), WANTED.get(row, "")] for row in columns[0]]
    return table(header, rows)


def write_plot(steps: Mapping[str, Sequence[Step]], ends: Mapping[str, End], path: Path) -> None:
    """PSNR and the number of Gaussians after each change, as a PNG."""
    figure = Figure(figsize=(8, 6), layout="constrained")
    FigureCanvasAgg(figure)
    upper, lower = figure.subplots(2, sharex=True)
    for number, (name, own) in enumerate(steps.items()):
        color = f"C{number}"
        looked = [(k, one.psnr_db) for k, one in enumerate(own, start=1) if one.psnr_db is not None]
        places, psnrs_db = [place for place, _ in looked], [psnr_db for _, psnr_db in looked]
        upper.plot(places, psnrs_db, "-o", color=color, label=f"{name}, updated")
        counts = [one.gaussians for one in own]
        lower.plot(range(1, len(own) + 1), counts, "-", color=color, label=f"{name}, updated")
        if name not in ends:
            continue
        for map_, marker in ((BEFORE, "x"), (ANEW, "*")):
            label = f"{name}, {map_}"
            upper.plot(len(own), ends[name].psnr_db[map_], marker, color=color, label=label)
            lower.plot(len(own), ends[name].gaussians[map_], marker, color=color, label=label)
    upper.set(ylabel="PSNR of fresh views, dB")
    lower.set(xlabel="changes", ylabel="Gaussians")
    for axes in (upper, lower):
        axes.grid(visible=True, alpha=0.25)
        axes.legend(fontsize=8)
    figure.savefig(path, dpi=110)
