"""The results of change detection, as numbers and as tables in Markdown."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from gslts_bench.detection.run import Record
from gslts_bench.detection.score import (
    NONE,
    SIZE_NAMES,
    UNRELIABLE,
    SeveralScore,
    SingleScore,
    size_name,
)
from gslts_bench.detection.variants import STRATEGIES, TRADE
from gslts_bench.detection.watch import TURNS_DEG, WATCH
from gslts_bench.markdown import mean, share, table
from gslts_sim.tasks import KINDS

SAID = (*KINDS, NONE, UNRELIABLE)


def summary(records: Iterable[Record], variant: str) -> dict[str, Any]:
    """The numbers of one detector, in values of JSON; shares as [count, of]."""
    own = [one for one in records if one.variant == variant and one.error is None]
    singles = [SingleScore.of(one) for one in own if one.part == "single"]
    several = {
        part: SeveralScore.of(one for one in own if one.part == part) for part in ("pair", "triple")
    }
    visits = [one for one in own if one.part == "unchanged"]
    count = len(singles)
    return {
        "single": {
            "right": [sum(one.right for one in singles), count],
            "type": [sum(one.said == one.kind for one in singles), count],
            "region": [sum(one.region for one in singles), count],
            "found": [sum(one.found for one in singles), count],
            "unreliable": [sum(one.said == UNRELIABLE for one in singles), count],
            "extra_reports": [sum(one.extra for one in singles), count],
            "by_type": _by(singles, lambda one: one.kind, KINDS),
            "by_size": _by(singles, lambda one: size_name(one.size_px), SIZE_NAMES),
            "by_object": _by(
                singles, lambda one: one.object_type, sorted({one.object_type for one in singles})
            ),
            "confusion": confusion(singles),
            "confusion_by_size": {
                name: confusion([one for one in singles if size_name(one.size_px) == name])
                for name in SIZE_NAMES
            },
        },
        **{
            part: {
                "found": [score.found, score.changes],
                "false_reports": [score.false, score.frames],
            }
            for part, score in several.items()
        },
        "unchanged": {
            "with_reports": [sum(bool(one.reports) for one in visits), len(visits)],
            "unreliable": [sum(one.unreliable is not None for one in visits), len(visits)],
        },
        "ms": {
            "single": _median([one.ms for one in own if one.part == "single"]),
            "single_cpu": _median([one.cpu_ms for one in own if one.part == "single"]),
            "all": _median([one.ms for one in own]),
            "all_cpu": _median([one.cpu_ms for one in own]),
        },
    }


def confusion(singles: Iterable[SingleScore]) -> dict[str, dict[str, int]]:
    """How often each type of change was told as each type, as none or not at all."""
    counts = Counter((one.kind, one.said) for one in singles)
    return {kind: {said: counts[kind, said] for said in SAID} for kind in KINDS}


def counted(records: Sequence[Record]) -> str:
    """How many cases there are of each part, and in how many homes."""
    parts: Counter[str] = Counter(
        {one.case: one.part for one in records if one.error is None}.values()
    )
    homes = {one.case.partition("/")[0] for one in records if one.error is None}
    names = {"single": "single changes", "pair": "pairs", "triple": "triples"}
    names["unchanged"] = "visits of unchanged homes"
    cases = ", ".join(f"{parts[part]} {name}" for part, name in names.items())
    return f"{cases}; {len(homes)} home(s)"


def printed(summaries: Mapping[str, dict[str, Any]]) -> str:
    """All tables; `summaries` are those of `STRATEGIES`, and of others that were measured."""
    strategies = {name: summaries[name] for name in STRATEGIES}
    parts = ["## Change detection", _overview(strategies)]
    if WATCH in summaries:
        title = f"### {len(TURNS_DEG)} frames as the robot turns, confirmed by `ChangeMonitor`"
        parts += [title, _watching(summaries[WATCH])]
    for title, key in (
        ("Type and region right, by type of change", "by_type"),
        ("Type and region right, by size of the object in view (of 640 x 480)", "by_size"),
        ("Type and region right, by object", "by_object"),
    ):
        parts += [f"### {title}", _compared(strategies, key)]
    for name, one in strategies.items():
        parts += [f"### What `{name}` said of each type of change", _confusions(one["single"])]
    if all(name in summaries for name in TRADE):
        parts += ["### Speed against accuracy", _trade({name: summaries[name] for name in TRADE})]
    return "\n\n".join(parts)


def _by(
    singles: Sequence[SingleScore], key: Callable[[SingleScore], str], names: Iterable[str]
) -> dict[str, list[int]]:
    groups: dict[str, list[bool]] = {name: [] for name in names}
    for one in singles:
        groups[key(one)].append(one.right)
    return {name: [sum(rights), len(rights)] for name, rights in groups.items()}


def _overview(strategies: Mapping[str, dict[str, Any]]) -> str:
    def row(name: str, wanted: str, tell: Callable[[dict[str, Any]], str]) -> list[str]:
        return [name, *map(tell, strategies.values()), wanted]

    def several(one: dict[str, Any], key: str) -> tuple[int, int]:
        pairs, triples = one["pair"][key], one["triple"][key]
        return pairs[0] + triples[0], pairs[1] + triples[1]

    rows = [
        row("one change: type and region right", "90 %", lambda s: share(*s["single"]["right"])),
        row("- type right", "", lambda s: share(*s["single"]["type"])),
        row("- region right", "", lambda s: share(*s["single"]["region"])),
        row("- told by any report", "", lambda s: share(*s["single"]["found"])),
        row("- unreliable", "", lambda s: share(*s["single"]["unreliable"])),
        row("- other reports in a frame", "", lambda s: mean(*s["single"]["extra_reports"])),
        row("two and three changes: found", "80 %", lambda s: share(*several(s, "found"))),
        row("- of two", "", lambda s: share(*s["pair"]["found"])),
        row("- of three", "", lambda s: share(*s["triple"]["found"])),
        row("- false reports in a frame", "", lambda s: mean(*several(s, "false_reports"))),
        row("no change: visits with reports", "1 of 200", _false_visits),
        row("- unreliable", "", lambda s: share(*s["unchanged"]["unreliable"])),
        row("median time on one core", "60 ms", lambda s: _ms(s["ms"]["all"])),
        row("- of it on the core", "", lambda s: _ms(s["ms"]["all_cpu"])),
    ]
    return table(["", *(f"`{name}`" for name in strategies), "wanted"], rows)


def _watching(one: dict[str, Any]) -> str:
    rows = [
        ["one change: told", share(*one["single"]["found"])],
        ["- other reports", mean(*one["single"]["extra_reports"])],
        ["no change: visits with reports", _false_visits(one)],
        ["- unreliable", share(*one["unchanged"]["unreliable"])],
    ]
    return table(["", f"`{WATCH}`"], rows)


def _false_visits(one: dict[str, Any]) -> str:
    count, of = one["unchanged"]["with_reports"]
    return f"{count} of {of}"


def _compared(strategies: Mapping[str, dict[str, Any]], key: str) -> str:
    groups = [one["single"][key] for one in strategies.values()]
    # Where all cases of an object failed in one of them, it is not there.
    names = dict.fromkeys(name for group in groups for name in group)
    rows = [[name, *(share(*group.get(name, (0, 0))) for group in groups)] for name in names]
    return table(["", *(f"`{name}`" for name in strategies)], rows)


def _confusions(single: dict[str, Any]) -> str:
    rows = [
        [f"{kind}, {size}", *(str(counts[said]) for said in SAID)]
        for size, of_size in (("all", single["confusion"]), *single["confusion_by_size"].items())
        for kind, counts in of_size.items()
        if any(counts.values())
    ]
    return table(["happened", *SAID], rows)


def _trade(summaries: Mapping[str, dict[str, Any]]) -> str:
    rows = [
        [
            name,
            share(*one["single"]["right"]),
            share(*one["single"]["found"]),
            mean(*one["single"]["extra_reports"]),
            _ms(one["ms"]["single"]),
            _ms(one["ms"]["single_cpu"]),
        ]
        for name, one in summaries.items()
    ]
    header = ["", "type and region right", "told by any report", "other reports"]
    header += ["median time", "of it on the core"]
    return table(header, rows)


def _median(times: Sequence[float]) -> float | None:
    return float(np.median(times)) if times else None


def _ms(ms: float | None) -> str:
    return "-" if ms is None else f"{ms:.0f} ms"
