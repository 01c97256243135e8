"""Numbers, tables and plot of queries."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from gslts_bench.queries.run import ABLATION, CATEGORIES, DETECTOR, OURS, TRADE, Record
from gslts_bench.runner import Benchmark
from gslts_bench.tables import Table, number, share

GS_LTS = {"mIoU": 0.609, "Acc@0.5": 0.736, "Acc@0.3": 0.818}
"""GS-LTS (GT), table II; in rooms of AI2-THOR, so it orders the size of numbers at most."""


def summarize(records: Sequence[Record]) -> dict[str, Any]:
    """Compute the numbers of all variants, over all homes.

    Args:
        records: Records without error.

    Returns:
        JSON values by variant.
    """
    by_variant: dict[str, list[Record]] = {}
    for record in records:
        by_variant.setdefault(record.variant, []).append(record)
    return {name: _numbers(own) for name, own in by_variant.items()}


def _numbers(records: Sequence[Record]) -> dict[str, Any]:
    found = [entry for record in records for entry in record.found]
    by_category = {
        name: [entry.iou for entry in found if entry.category == name]
        for name in dict.fromkeys((*CATEGORIES, *(entry.category for entry in found)))
    }
    return {
        "homes": len(records),
        "objects": len(found),
        **_scores([entry.iou for entry in found]),
        "categories": {
            name: {"objects": len(ious), **_scores(ious)}
            for name, ious in by_category.items()
            if ious
        },
        "extra": sum(record.extra for record in records),
        "absent": [sum(record.absent[side] for record in records) for side in (0, 1)],
        "gaussians": float(np.mean([record.gaussians for record in records])),
        "feature_bytes": float(np.mean([record.feature_bytes for record in records])),
        "embedding_s": float(np.median([record.embedding_s for record in records])),
        "query_s": float(np.median([s for record in records for s in record.query_s])),
    }


def _scores(ious: Sequence[float]) -> dict[str, float | None]:
    if not ious:
        return dict.fromkeys(GS_LTS)
    found = np.array(ious)
    return {
        "mIoU": float(found.mean()),
        "Acc@0.5": float((found > 0.5).mean()),
        "Acc@0.3": float((found > 0.3).mean()),
    }


def tabulate(found: Mapping[str, Any]) -> list[Table]:
    """Make all tables.

    Args:
        found: From `summarize`.
    """
    tables = [_variants(found)]
    if ours := found.get(OURS):
        rows = [
            [name, str(numbers["objects"]), *(number(numbers[key], 3) for key in GS_LTS)]
            for name, numbers in ours["categories"].items()
        ]
        note = (
            f"{ours['extra']} boxes belong to no object of their category; categories that a home "
            f"lacks and that were found all the same: {share(*ours['absent'])}."
        )
        tables += [Table("By category", ["category", "objects", *GS_LTS], rows, note)]
    return tables


BENCHMARK = Benchmark("Queries", "asking", summarize, tabulate)
"""The benchmark of queries."""


def _variants(found: Mapping[str, Any]) -> Table:
    rows = [["GS-LTS (GT), as printed", "", *(f"{v:.3f}" for v in GS_LTS.values()), *[""] * 3]]
    for name in (OURS, *TRADE, *ABLATION, *DETECTOR):
        if numbers := found.get(name):
            rows.append(
                [
                    name,
                    f"{numbers['objects']} in {numbers['homes']} home(s)",
                    *(number(numbers[key], 3) for key in GS_LTS),
                    f"{numbers['feature_bytes'] / 2**20:.1f} MiB",
                    f"{numbers['embedding_s']:.0f} s",
                    f"{1000 * numbers['query_s']:.0f} ms",
                ]
            )
    return Table("", ["", "objects", *GS_LTS, "features", "embedding", "a query"], rows)


def write_plot(found: Mapping[str, Any], path: Path) -> None:
    """Plot mIoU, bytes and seconds against the length of a feature, as a PNG.

    Args:
        found: From `summarize`.
        path: File to write.
    """
    lengths = {int(name.split()[-1]): name for name in (OURS, *TRADE) if name in found}
    figure = Figure(figsize=(10, 3.2), layout="constrained")
    FigureCanvasAgg(figure)
    panels: tuple[tuple[str, Callable[[Any], float]], ...] = (
        ("mIoU", lambda numbers: numbers["mIoU"]),
        ("features of a map, MiB", lambda numbers: numbers["feature_bytes"] / 2**20),
        ("embedding a map, s on one core", lambda numbers: numbers["embedding_s"]),
    )
    for axes, (label, value) in zip(figure.subplots(1, len(panels)), panels, strict=True):
        ordered = sorted(lengths)
        axes.plot(ordered, [value(found[lengths[length]]) for length in ordered], marker="o")
        axes.set(xlabel="length of a feature, d", ylabel=label, xscale="log", ylim=(0, None))
        axes.set_xticks(ordered, [str(length) for length in ordered])
        axes.minorticks_off()
        axes.grid(visible=True, alpha=0.25)
    figure.savefig(path, dpi=110)
