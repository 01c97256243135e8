"""The results of updates, as numbers and as tables in Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from gslts_bench.markdown import share, table
from gslts_bench.update.methods import ABLATION, METHODS
from gslts_bench.update.run import CURVE_OF, Record
from gslts_sim.tasks import KINDS

NO_UPDATE, BASELINE, OURS = "no update", "plain fine-tuning", "ours"
OVERALL = "overall"
VIEWS = ("near", "far")
METRICS = {"SSIM": "ssim", "PSNR": "psnr_db", "FLIP": "flip", "LPIPS": "lpips"}
DIGITS = {"psnr_db": 2}


def summary(records: Sequence[Record]) -> dict[str, Any]:
    """Means over the tasks that every method was tried on, in values of JSON."""
    fine = [one for one in records if one.error is None]
    tasks = {one.task for one in fine}
    missed = {one.task for one in fine if one.method == "not detected"}
    by_method = {name: _of_method(fine, name) for name in (*METHODS, *ABLATION)}
    return {
        "tasks": len(tasks),
        "detected": [len(tasks) - len(missed), len(tasks)],
        "methods": {name: one for name, one in by_method.items() if one},
        "curves": {name: _curve(fine, name) for name in CURVE_OF},
        "ours": _told_of_ours(fine),
    }


def printed(found: Mapping[str, Any]) -> str:
    """All tables."""
    methods: Mapping[str, Any] = found["methods"]
    parts = ["## Updates after a change", _overview(found)]
    parts += [_paper_table({one: methods[one] for one in METHODS if one in methods})]
    if any(one in methods for one in ABLATION):
        rows = [OURS, *(one for one in ABLATION if one in methods)]
        parts += ["### One thing changed", _ablation({one: methods[one] for one in rows})]
    if any(found["curves"].values()):
        parts += ["### PSNR against iterations (near / far, dB)", _curve_table(found["curves"])]
    return "\n\n".join(parts)


def _of_method(records: Iterable[Record], method: str) -> dict[str, Any]:
    own = [one for one in records if one.method == method]
    if not own:
        return {}
    kinds = {kind: [one for one in own if one.kind == kind] for kind in KINDS}
    return {
        **{kind: _means(group) for kind, group in kinds.items() if group},
        OVERALL: _means(own),
        "seconds": _median([one.seconds["update"] for one in own]),
    }


def _means(records: Sequence[Record]) -> dict[str, Any]:
    result: dict[str, Any] = {"tasks": len(records)}
    for view in VIEWS:
        scores = [one.scores[view] for one in records]
        result[view] = {
            name: None
            if any(score[name] is None for score in scores)
            else float(np.mean([score[name] for score in scores if score[name] is not None]))
            for name in scores[0]
        }
    return result


def _curve(records: Iterable[Record], method: str) -> dict[str, list[float]]:
    own = [one.curve for one in records if one.method == f"curve, {method}"]
    if not own:
        return {}
    return {mark: np.mean([one[mark] for one in own], axis=0).tolist() for mark in own[0]} | {
        "tasks": [float(len(own))]
    }


def _told_of_ours(records: Iterable[Record]) -> dict[str, Any]:
    own = [one for one in records if one.method == OURS]
    done = [one for one in own if one.rejected is None]
    if not done:
        return {}
    stages = ("collecting", "editing", "refining", "verifying")
    return {
        "rejected": [len(own) - len(done), len(own)],
        "reasons": sorted({one.rejected.partition(":")[0] for one in own if one.rejected}),
        "seconds": {name: _median([one.seconds[name] for one in done]) for name in stages},
        "slowest_s": max(one.seconds["editing"] + one.seconds["refining"] for one in done),
        "growth": float(np.mean([one.gaussians[1] / one.gaussians[0] - 1 for one in done])),
        "removed": _median([one.removed for one in done]),
        "added": _median([one.added for one in done]),
        "views": _median([one.views for one in done]),
    }


def _overview(found: Mapping[str, Any]) -> str:
    rows = [
        ["tasks", str(found["tasks"]), ""],
        ["detected in the first frame, and updated", share(*found["detected"]), ""],
    ]
    methods, ours = found["methods"], found["ours"]
    if ours and BASELINE in methods:
        for view, wanted in (("near", "+3"), ("far", "+2.5")):
            gain = _gain(methods, view)
            rows.append([f"`ours` over plain fine-tuning, {view}", f"{gain:+.2f} dB", wanted])
        outside = min(
            methods[OURS][OVERALL][view]["outside_db"]
            - methods[NO_UPDATE][OVERALL][view]["outside_db"]
            for view in VIEWS
        )
        seconds = ours["seconds"]
        edit_s = seconds["editing"] + seconds["refining"]
        rows += [
            ["outside the crops, against no update", f"{outside:+.2f} dB", "-0.05"],
            ["edit and refinement, median", f"{edit_s:.2f} s", ""],
            ["- collection, in simulation", f"{seconds['collecting']:.1f} s", ""],
            ["rejected", share(*ours["rejected"]), ""],
            ["Gaussians", f"{100 * ours['growth']:+.2f} %", ""],
        ]
    return table(["", "", "wanted"], rows)


def _gain(methods: Mapping[str, Any], view: str) -> float:
    ours, baseline = (methods[name][OVERALL][view]["psnr_db"] for name in (OURS, BASELINE))
    return float(ours - baseline)


def _paper_table(methods: Mapping[str, Any]) -> str:
    groups = (*KINDS, OVERALL)
    metrics = {
        label: name
        for label, name in METRICS.items()
        if all(one[OVERALL]["near"][name] is not None for one in methods.values())
    }
    header = ["method", "view"]
    header += [f"{group} {label}" for group in groups for label in metrics]
    rows = []
    for method, one in methods.items():
        for view in VIEWS:
            cells = [
                f"{one[group][view][name]:.{DIGITS.get(name, 3)}f}" if group in one else "-"
                for group in groups
                for name in metrics.values()
            ]
            rows.append([method, view, *cells])
    return table(header, rows)


def _ablation(methods: Mapping[str, Any]) -> str:
    rows = []
    for name, one in methods.items():
        cells = [
            f"{one[group][view]['psnr_db']:.2f}" if group in one else "-"
            for group in (*KINDS, OVERALL)
            for view in VIEWS
        ]
        rows.append([name, *cells, f"{one['seconds']:.1f} s"])
    header = [f"{group}, {view}" for group in (*KINDS, OVERALL) for view in VIEWS]
    return table(["PSNR, dB", *header, "time"], rows)


def _curve_table(curves: Mapping[str, Mapping[str, Sequence[float]]]) -> str:
    marks = list(dict.fromkeys(mark for one in curves.values() for mark in one if mark != "tasks"))
    rows = []
    for name, one in curves.items():
        cells = ["-" if mark not in one else "{:.2f} / {:.2f}".format(*one[mark]) for mark in marks]
        rows.append([name, *cells])
    return table(["iterations", *marks], rows)


def _median(numbers: Sequence[float]) -> float:
    return float(np.median(numbers))
