"""Numbers and tables of updates."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from gslts_bench.runner import Benchmark
from gslts_bench.tables import Table, number, share
from gslts_bench.update.methods import ABLATION, METHODS
from gslts_bench.update.run import CURVE_OF, NOT_DETECTED, Record
from gslts_sim.tasks import KINDS

NO_UPDATE, BASELINE, OURS = "no update", "plain fine-tuning", "ours"
"""Methods of `METHODS` that the table compares."""
OVERALL = "overall"
"""Row of all kinds of change."""
VIEWS = ("near", "far")
"""Test viewpoints by their distance from the change."""
METRICS = {"SSIM": ("ssim", 3), "PSNR": ("psnr_db", 2), "FLIP": ("flip", 3), "LPIPS": ("lpips", 3)}
"""Field of `Score` and number of digits by column."""


def summarize(records: Sequence[Record]) -> dict[str, Any]:
    """Compute means over the tasks that have a record of every method of the run.

    Args:
        records: Records without error.

    Returns:
        JSON values.
    """
    updated = _of_all(records, [*METHODS, *ABLATION])
    curves = _of_all(records, [f"curve, {name}" for name in CURVE_OF])
    detected = len({record.task for record in updated})
    missed = len({record.task for record in records if record.method == NOT_DETECTED})
    by_method = {name: _numbers(updated, name) for name in (*METHODS, *ABLATION)}
    return {
        "tasks": detected + missed,
        "detected": [detected, detected + missed],
        "methods": {name: numbers for name, numbers in by_method.items() if numbers},
        "curves": {name: _curve(curves, name) for name in CURVE_OF},
        "ours": _details(updated),
    }


def tabulate(found: Mapping[str, Any]) -> list[Table]:
    """Make all tables.

    Args:
        found: From `summarize`.
    """
    methods: Mapping[str, Any] = found["methods"]
    tables = [
        _overview(found),
        _scores({name: methods[name] for name in METHODS if name in methods}),
    ]
    if any(name in methods for name in ABLATION):
        rows = [OURS, *(name for name in ABLATION if name in methods)]
        tables += [_ablation({name: methods[name] for name in rows})]
    if any(found["curves"].values()):
        tables += [_curve_table(found["curves"])]
    return tables


BENCHMARK = Benchmark("Updates after a change", "updating", summarize, tabulate)
"""The benchmark of updates."""


def _of_all(records: Iterable[Record], methods: Sequence[str]) -> list[Record]:
    """Return the records of some methods, without tasks for which one that was run has none."""
    own = [record for record in records if record.method in methods]
    tasks: dict[str, set[str]] = {}
    for record in own:
        tasks.setdefault(record.method, set()).add(record.task)
    return [record for record in own if all(record.task in some for some in tasks.values())]


def _numbers(records: Iterable[Record], method: str) -> dict[str, Any]:
    own = [record for record in records if record.method == method]
    if not own:
        return {}
    kinds = {kind: [record for record in own if record.kind == kind] for kind in KINDS}
    return {
        **{kind: _means(group) for kind, group in kinds.items() if group},
        OVERALL: _means(own),
        "seconds": _median([record.seconds["update"] for record in own]),
    }


def _means(records: Sequence[Record]) -> dict[str, Any]:
    result: dict[str, Any] = {"tasks": len(records)}
    for view in VIEWS:
        scores = [record.scores[view] for record in records]
        result[view] = {
            name: None
            if any(score[name] is None for score in scores)
            else float(np.mean([score[name] for score in scores if score[name] is not None]))
            for name in scores[0]
        }
    return result


def _curve(records: Iterable[Record], method: str) -> dict[str, list[float]]:
    own = [record.curve for record in records if record.method == f"curve, {method}"]
    if not own:
        return {}
    marks = dict.fromkeys(mark for curve in own for mark in curve)
    points = {mark: [curve[mark] for curve in own if mark in curve] for mark in marks}
    means = {mark: np.mean(values, axis=0).tolist() for mark, values in points.items()}
    return means | {"tasks": [float(len(own))]}


def _details(records: Iterable[Record]) -> dict[str, Any]:
    """Compute times, counts and rejections of our method; empty without an update."""
    own = [record for record in records if record.method == OURS]
    done = [record for record in own if record.rejected is None]
    if not done:
        return {}
    stages = ("collecting", "editing", "refining", "verifying")
    edit_s = [record.seconds["editing"] + record.seconds["refining"] for record in done]
    growths = [record.gaussians[1] / record.gaussians[0] - 1 for record in done]
    return {
        "rejected": [len(own) - len(done), len(own)],
        "reasons": sorted({record.rejected.partition(":")[0] for record in own if record.rejected}),
        "seconds": {name: _median([record.seconds[name] for record in done]) for name in stages},
        "slowest_s": max(edit_s),
        "growth": float(np.mean(growths)),
        "removed": _median([record.removed for record in done]),
        "added": _median([record.added for record in done]),
        "views": _median([record.views for record in done]),
    }


def _overview(found: Mapping[str, Any]) -> Table:
    rows = [
        ["tasks", str(found["tasks"]), ""],
        ["detected in the first frame, and updated", share(*found["detected"]), ""],
    ]
    methods, ours = found["methods"], found["ours"]
    if ours and BASELINE in methods:
        for view, target in (("near", "+3"), ("far", "+2.5")):
            gain = _difference(methods, OURS, BASELINE, view, "psnr_db")
            rows.append([f"`ours` over plain fine-tuning, {view}", f"{gain:+.2f} dB", target])
        outside = min(_difference(methods, OURS, NO_UPDATE, view, "outside_db") for view in VIEWS)
        seconds = ours["seconds"]
        edit_s = seconds["editing"] + seconds["refining"]
        rows += [
            ["outside the crops, against no update", f"{outside:+.2f} dB", "-0.05"],
            ["edit and refinement, median", f"{edit_s:.2f} s", ""],
            ["- collection, in simulation", f"{seconds['collecting']:.1f} s", ""],
            ["rejected", share(*ours["rejected"]), ""],
            ["Gaussians", f"{100 * ours['growth']:+.2f} %", ""],
        ]
    return Table("", ["", "", "target"], rows)


def _difference(methods: Mapping[str, Any], a: str, b: str, view: str, metric: str) -> float:
    return float(methods[a][OVERALL][view][metric] - methods[b][OVERALL][view][metric])


def _scores(methods: Mapping[str, Any]) -> Table:
    groups = (*KINDS, OVERALL)
    metrics = {
        label: (name, digits)
        for label, (name, digits) in METRICS.items()
        if all(numbers[OVERALL]["near"][name] is not None for numbers in methods.values())
    }
    header = ["method", "view", *(f"{group} {label}" for group in groups for label in metrics)]
    rows = []
    for method, numbers in methods.items():
        for view in VIEWS:
            cells = [
                number(numbers[group][view][name], digits) if group in numbers else "-"
                for group in groups
                for name, digits in metrics.values()
            ]
            rows.append([method, view, *cells])
    return Table("", header, rows)


def _ablation(methods: Mapping[str, Any]) -> Table:
    groups = [(group, view) for group in (*KINDS, OVERALL) for view in VIEWS]
    rows = []
    for name, numbers in methods.items():
        cells = [
            number(numbers[group][view]["psnr_db"], 2) if group in numbers else "-"
            for group, view in groups
        ]
        rows.append([name, *cells, f"{numbers['seconds']:.1f} s"])
    header = ["PSNR, dB", *(f"{group}, {view}" for group, view in groups), "time"]
    return Table("One setting changed", header, rows)


def _curve_table(curves: Mapping[str, Mapping[str, Sequence[float]]]) -> Table:
    marks = list(
        dict.fromkeys(mark for curve in curves.values() for mark in curve if mark != "tasks")
    )
    rows = []
    for name, curve in curves.items():
        cells = [
            "-" if mark not in curve else "{:.2f} / {:.2f}".format(*curve[mark]) for mark in marks
        ]
        rows.append([name, *cells])
    return Table("PSNR against iterations (near / far, dB)", ["iterations", *marks], rows)


def _median(numbers: Sequence[float]) -> float:
    return float(np.median(numbers))
