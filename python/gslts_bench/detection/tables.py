"""Numbers and tables of change detection."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict
from itertools import pairwise
from typing import Any

import numpy as np

from gslts_bench.detection.run import Record
from gslts_bench.detection.score import (
    CONFIDENCE_EDGES,
    NONE,
    SIZE_NAMES,
    UNRELIABLE,
    Calibration,
    SeveralScore,
    SingleScore,
    size_name,
)
from gslts_bench.detection.shift_tables import shift_summary, shift_table
from gslts_bench.detection.variants import STRATEGIES, TRADE, VARIANTS
from gslts_bench.detection.watch import TURNS_DEG, WATCH
from gslts_bench.runner import Benchmark
from gslts_bench.tables import Table, mean, number, share
from gslts_sim.tasks import KINDS

SAID = (*KINDS, "shift", NONE, UNRELIABLE)
"""Columns of the table of reports."""


def summarize(records: Sequence[Record]) -> dict[str, Any]:
    """Compute the numbers of all detectors.

    Args:
        records: Records without error.

    Returns:
        JSON values: `cases` counts them in words, `detectors` holds `summary` by name.
    """
    asked = {record.variant for record in records} | set(STRATEGIES)
    parts: Counter[str] = Counter({record.case: record.part for record in records}.values())
    homes = {record.case.partition("/")[0] for record in records}
    names = {"single": "single changes", "pair": "pairs", "triple": "triples"}
    names |= {"unchanged": "visits of unchanged homes", "shifted": "shifted objects"}
    cases = ", ".join(f"{parts[part]} {name}" for part, name in names.items())
    return {
        "cases": f"{cases}; {len(homes)} home(s)",
        "detectors": {name: summary(records, name) for name in (*VARIANTS, WATCH) if name in asked},
    }


def summary(records: Iterable[Record], variant: str) -> dict[str, Any]:
    """Compute the numbers of one detector.

    Args:
        records: Records without error.
        variant: Name of the detector.

    Returns:
        JSON values; shares as [count, of].
    """
    seen = [record for record in records if record.variant == variant]
    shifted = [record for record in seen if record.part == "shifted"]
    own = [record for record in seen if record.part != "shifted"]
    singles = [SingleScore.of(record) for record in own if record.part == "single"]
    visits = [record for record in own if record.part == "unchanged"]
    count = len(singles)
    several = {}
    for part in ("pair", "triple"):
        score = SeveralScore.of(record for record in own if record.part == part)
        several[part] = {
            "found": [score.found, score.changes],
            "false_reports": [score.false, score.frames],
        }
    object_types = sorted({score.object_type for score in singles})
    of_singles = [record for record in own if record.part == "single"]
    calibration = Calibration.of(own)
    return {
        "single": {
            "right": [sum(score.right for score in singles), count],
            "type": [sum(score.said == score.kind for score in singles), count],
            "region": [sum(score.region for score in singles), count],
            "found": [sum(score.found for score in singles), count],
            "unreliable": [sum(score.said == UNRELIABLE for score in singles), count],
            "extra_reports": [sum(score.extra for score in singles), count],
            "by_type": _by(singles, lambda score: score.kind, KINDS),
            "by_size": _by(singles, lambda score: size_name(score.size_px), SIZE_NAMES),
            "by_object": _by(singles, lambda score: score.object_type, object_types),
            "confusion": confusion(singles),
            "confusion_by_size": {
                name: confusion([score for score in singles if size_name(score.size_px) == name])
                for name in SIZE_NAMES
            },
        },
        **several,
        "unchanged": {
            "with_reports": [sum(bool(record.reports) for record in visits), len(visits)],
            "unreliable": [sum(record.unreliable is not None for record in visits), len(visits)],
        },
        "shifted": shift_summary(shifted, own),
        "calibration": {**asdict(calibration), "error": calibration.error},
        "ms": {
            "single": _median([record.ms for record in of_singles]),
            "single_cpu": _median([record.cpu_ms for record in of_singles]),
            "all": _median([record.ms for record in own]),
            "all_cpu": _median([record.cpu_ms for record in own]),
        },
    }


def confusion(singles: Iterable[SingleScore]) -> dict[str, dict[str, int]]:
    """Count how often each type of change was reported as each type, as none or not at all.

    Args:
        singles: Scores of frames with one change.
    """
    counts = Counter((score.kind, score.said) for score in singles)
    return {kind: {said: counts[kind, said] for said in SAID} for kind in KINDS}


def tabulate(found: Mapping[str, Any]) -> list[Table]:
    """Make all tables.

    Args:
        found: From `summarize`.
    """
    detectors = found["detectors"]
    strategies = {name: detectors[name] for name in STRATEGIES}
    tables = [_overview(strategies)]
    if WATCH in detectors:
        tables += [_watching(detectors[WATCH])]
    tables += [
        shift_table(strategies),
        _comparison("Type and region right, by type of change", strategies, "by_type"),
        _comparison(
            "Type and region right, by size of the object in view (of 640 x 480)",
            strategies,
            "by_size",
        ),
        _comparison("Type and region right, by object", strategies, "by_object"),
    ]
    tables += [_calibration(strategies)]
    tables += [_confusions(name, strategy["single"]) for name, strategy in strategies.items()]
    if all(name in detectors for name in TRADE):
        tables += [_trade({name: detectors[name] for name in TRADE})]
    return tables


BENCHMARK = Benchmark("Change detection", "detecting", summarize, tabulate)
"""The benchmark of change detection."""


def _by(
    singles: Sequence[SingleScore], key: Callable[[SingleScore], str], names: Iterable[str]
) -> dict[str, list[int]]:
    groups: dict[str, list[bool]] = {name: [] for name in names}
    for score in singles:
        groups[key(score)].append(score.right)
    return {name: [sum(rights), len(rights)] for name, rights in groups.items()}


def _overview(strategies: Mapping[str, dict[str, Any]]) -> Table:
    def row(name: str, target: str, cell: Callable[[dict[str, Any]], str]) -> list[str]:
        return [name, *map(cell, strategies.values()), target]

    def several(numbers: dict[str, Any], key: str) -> tuple[int, int]:
        pairs, triples = numbers["pair"][key], numbers["triple"][key]
        return pairs[0] + triples[0], pairs[1] + triples[1]

    rows = [
        row("one change: type and region right", "95 %", lambda s: share(*s["single"]["right"])),
        row("- type right", "", lambda s: share(*s["single"]["type"])),
        row("- region right", "", lambda s: share(*s["single"]["region"])),
        row("- found by any report", "", lambda s: share(*s["single"]["found"])),
        row("- unreliable", "", lambda s: share(*s["single"]["unreliable"])),
        row("- other reports in a frame", "", lambda s: mean(*s["single"]["extra_reports"])),
        row("two and three changes: found", "80 %", lambda s: share(*several(s, "found"))),
        row("- of two", "", lambda s: share(*s["pair"]["found"])),
        row("- of three", "", lambda s: share(*s["triple"]["found"])),
        row("- false reports in a frame", "", lambda s: mean(*several(s, "false_reports"))),
        row("no change: visits with reports", "1 of 200", _false_visits),
        row("- unreliable", "", lambda s: share(*s["unchanged"]["unreliable"])),
        row("median time on one core", "60 ms", lambda s: number(s["ms"]["all"], 0, "ms")),
        row("- CPU time", "", lambda s: number(s["ms"]["all_cpu"], 0, "ms")),
    ]
    return Table("", ["", *(f"`{name}`" for name in strategies), "target in our homes"], rows)


def _watching(numbers: dict[str, Any]) -> Table:
    rows = [
        ["one change: found", share(*numbers["single"]["found"])],
        ["- other reports", mean(*numbers["single"]["extra_reports"])],
        ["no change: visits with reports", _false_visits(numbers)],
        ["- unreliable", share(*numbers["unchanged"]["unreliable"])],
    ]
    title = f"{len(TURNS_DEG)} frames as the robot turns, confirmed by `ChangeMonitor`"
    return Table(title, ["", f"`{WATCH}`"], rows)


def _false_visits(numbers: dict[str, Any]) -> str:
    count, of = numbers["unchanged"]["with_reports"]
    return f"{count} of {of}"


def _comparison(title: str, strategies: Mapping[str, dict[str, Any]], key: str) -> Table:
    groups = [numbers["single"][key] for numbers in strategies.values()]
    # An object is not in a group where all of its cases failed.
    names = dict.fromkeys(name for group in groups for name in group)
    rows = [[name, *(share(*group.get(name, (0, 0))) for group in groups)] for name in names]
    return Table(title, ["", *(f"`{name}`" for name in strategies)], rows)


def _calibration(strategies: Mapping[str, dict[str, Any]]) -> Table:
    groups = pairwise(CONFIDENCE_EDGES)
    found = [numbers["calibration"] for numbers in strategies.values()]
    rows = [
        [
            f"{low} to {high}",
            *(share(calibration["true"][k], calibration["reports"][k]) for calibration in found),
        ]
        for k, (low, high) in enumerate(groups)
        if any(calibration["reports"][k] for calibration in found)
    ]
    rows += [
        ["expected calibration error", *(number(calibration["error"], 2) for calibration in found)]
    ]
    header = ["confidence", *(f"`{name}`" for name in strategies)]
    return Table("True reports by confidence, in frames without shifts", header, rows)


def _confusions(name: str, single: dict[str, Any]) -> Table:
    rows = [
        [f"{kind}, {size}", *(str(counts[said]) for said in SAID)]
        for size, of_size in (("all", single["confusion"]), *single["confusion_by_size"].items())
        for kind, counts in of_size.items()
        if any(counts.values())
    ]
    return Table(f"Reports of `{name}` by type of change", ["happened", *SAID], rows)


def _trade(detectors: Mapping[str, dict[str, Any]]) -> Table:
    rows = [
        [
            name,
            share(*numbers["single"]["right"]),
            share(*numbers["single"]["found"]),
            mean(*numbers["single"]["extra_reports"]),
            number(numbers["ms"]["single"], 0, "ms"),
            number(numbers["ms"]["single_cpu"], 0, "ms"),
        ]
        for name, numbers in detectors.items()
    ]
    header = ["", "type and region right", "found by any report", "other reports"]
    return Table("Speed against accuracy", [*header, "median time", "CPU time"], rows)


def _median(times: Sequence[float]) -> float | None:
    return float(np.median(times)) if times else None
