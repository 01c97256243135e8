"""The results of localisation, as numbers, tables in Markdown and a picture."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from gslts_bench.markdown import share, table
from gslts_bench.queries.run import ABLATION, CATEGORIES, OURS, TRADE, Record

PAPER = {"mIoU": 0.609, "Acc@0.5": 0.736, "Acc@0.3": 0.818}
"""GS-LTS (GT), table II; in rooms of AI2-THOR, so no more than a landmark here."""


def summary(records: Sequence[Record]) -> dict[str, Any]:
    """By variant, over all homes, in values of JSON."""
    by_variant: dict[str, list[Record]] = {}
    for one in records:
        by_variant.setdefault(one.variant, []).append(one)
    return {name: _of_variant(own) for name, own in by_variant.items()}


def _of_variant(records: Sequence[Record]) -> dict[str, Any]:
    found = [one for record in records for one in record.found]
    ious = np.array([one.iou for one in found])
    by_category = {
        name: [one.iou for one in found if one.category == name]
        for name in CATEGORIES
        if any(one.category == name for one in found)
    }
    return {
        "homes": len(records),
        "objects": len(found),
        **_scores(ious),
        "categories": {
            name: {"objects": len(own), **_scores(np.array(own))}
            for name, own in by_category.items()
        },
        "extra": sum(record.extra for record in records),
        "absent": [sum(record.absent[side] for record in records) for side in (0, 1)],
        "gaussians": float(np.mean([record.gaussians for record in records])),
        "feature_bytes": float(np.mean([record.feature_bytes for record in records])),
        "teach_s": float(np.median([record.teach_s for record in records])),
        "query_s": float(np.median([one for record in records for one in record.query_s])),
    }


def _scores(ious: Any) -> dict[str, float | None]:
    if len(ious) == 0:
        return dict.fromkeys(PAPER)
    return {
        "mIoU": float(ious.mean()),
        "Acc@0.5": float((ious > 0.5).mean()),
        "Acc@0.3": float((ious > 0.3).mean()),
    }


def printed(found: Mapping[str, Any]) -> str:
    """All tables."""
    parts = ["## Localisation", _variants(found)]
    ours = found.get(OURS)
    if ours:
        rows = [
            [name, str(one["objects"]), *(f"{one[key]:.3f}" for key in PAPER)]
            for name, one in ours["categories"].items()
        ]
        parts += [table(["category", "objects", *PAPER], rows)]
        parts += [
            f"{ours['extra']} boxes where there is nothing of the kind; of categories that a home "
            f"lacks, found all the same: {share(*ours['absent'])}."
        ]
    return "\n\n".join(parts)


def _variants(found: Mapping[str, Any]) -> str:
    rows = [["GS-LTS (GT), as printed", "", *(f"{one:.3f}" for one in PAPER.values()), *[""] * 3]]
    for name in (OURS, *TRADE, *ABLATION):
        if one := found.get(name):
            rows.append(
                [
                    name,
                    f"{one['objects']} in {one['homes']} home(s)",
                    *("-" if one[key] is None else f"{one[key]:.3f}" for key in PAPER),
                    f"{one['feature_bytes'] / 2**20:.1f} MiB",
                    f"{one['teach_s']:.0f} s",
                    f"{1000 * one['query_s']:.0f} ms",
                ]
            )
    return table(["", "objects", *PAPER, "features", "teaching", "a query"], rows)


def write_plot(found: Mapping[str, Any], path: Path) -> None:
    """The length of a code against mIoU, bytes of the features and seconds, as a PNG.

    Args:
        found: From `summary`.
        path: Where to write.
    """
    names = sorted((OURS, *TRADE), key=lambda name: int(name.split()[-1]))
    names = [name for name in names if name in found]
    lengths = [int(name.split()[-1]) for name in names]
    figure = Figure(figsize=(10, 3.2), layout="constrained")
    FigureCanvasAgg(figure)
    panels: tuple[tuple[str, Callable[[Any], float]], ...] = (
        ("mIoU", lambda one: one["mIoU"]),
        ("features of a map, MiB", lambda one: one["feature_bytes"] / 2**20),
        ("teaching a map, s on one core", lambda one: one["teach_s"]),
    )
    for axes, (label, value) in zip(figure.subplots(1, len(panels)), panels, strict=True):
        axes.plot(lengths, [value(found[name]) for name in names], marker="o")
        axes.set(xlabel="numbers of a Gaussian, d", ylabel=label, xscale="log", ylim=(0, None))
        axes.set_xticks(lengths, [str(one) for one in lengths])
        axes.minorticks_off()
        axes.grid(visible=True, alpha=0.25)
    figure.savefig(path, dpi=110)
