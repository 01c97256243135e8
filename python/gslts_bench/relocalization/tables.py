"""The results of relocalization in simulated homes, as numbers and as tables in Markdown."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from gslts_bench.markdown import table
from gslts_bench.relocalization.frames import PARTS, Part
from gslts_bench.relocalization.run import Record
from gslts_bench.relocalization.score import MOVED_DEG, MOVED_M, scores
from gslts_bench.relocalization.variants import ABLATION, KNOBS, OURS, knob_name

ALL = "all"
OWN: tuple[Part, ...] = ("kept aside", "as mapped", "three changes")
TITLES = {
    "kept aside": "Frames of the recording that the map was made without",
    "as mapped": "From anywhere, also right before bare walls, with the light of a lamp moved",
    "three changes": "After three changes, in view or nearly so",
}
COUNTED = ("ok", "ambiguous", "lost", "near", "far")
STRANGE_HEADER = ("", "frames", "ok", "ambiguous", "lost")
TRACKED_HEADER = (
    *STRANGE_HEADER,
    *("2 cm, 1°", "5 cm, 5°", "median", "wrong `ok`", "error² / told", "time", "on the core"),
)
"""The squared error is in units of the covariance that was told, so that it should be about 1."""
LOCATED_HEADER = (*TRACKED_HEADER, "corners alone: 5 cm, 5°", "corners alone: median")

Row = Callable[[str, Mapping[str, Any]], list[str]]


def summary(records: Iterable[Record]) -> dict[str, Any]:
    """By variant, part and room type, in values of JSON; shares as counts."""
    done = [one for one in records if one.error is None]
    variants = dict.fromkeys(one.variant for one in done)
    return {name: _of_variant([one for one in done if one.variant == name]) for name in variants}


def _of_variant(records: Sequence[Record]) -> dict[str, Any]:
    own = [one for one in records if one.part in OWN]
    parts = {part: [one for one in records if one.part == part] for part in PARTS}
    numbers: dict[str, Any] = {part: _by_room_type(some) for part, some in parts.items() if some}
    return {**numbers, "own home": _numbers(own)}


def _by_room_type(records: Sequence[Record]) -> dict[str, Any]:
    types = sorted({one.room_type for one in records})
    groups = {name: [one for one in records if one.room_type == name] for name in types}
    return {name: _numbers(some) for name, some in {**groups, ALL: records}.items()}


def _numbers(records: Sequence[Record]) -> dict[str, Any]:
    return {
        "located": scores([one.located for one in records if one.located is not None]),
        "tracked": scores([one.tracked for one in records if one.tracked is not None]),
    }


def counted(records: Sequence[Record]) -> str:
    """How many frames there are of each part, and in how many maps."""
    frames = {(one.part, one.home, one.frame) for one in records if one.error is None}
    counts = {part: sum(one[0] == part for one in frames) for part in PARTS}
    homes = len({home for _, home, _ in frames})
    return (
        f"{counts['kept aside']} frames kept aside, {counts['as mapped']} of homes as mapped, "
        f"{counts['three changes']} after three changes, {counts['another home']} of other homes; "
        f"maps of {homes} home(s)"
    )


def printed(found: Mapping[str, Any]) -> str:
    """All tables."""
    ours = found.get(OURS, {})
    parts = ["## Relocalization in simulated homes"]
    for part in OWN:
        parts += _section(TITLES[part], _of(ours.get(part, {}), "located"), located_row)
    strangers = _of(ours.get("another home", {}), "located")
    parts += _section("Of other homes, which are nowhere in the map", strangers, _strange_row)
    for part in OWN:
        title = f"Tracked from {100 * MOVED_M:g} cm and {MOVED_DEG:g}° beside, {part}"
        parts += _section(title, _of(ours.get(part, {}), "tracked"), _tracked_row)
    ways = {name: found[name]["own home"] for name in (*ABLATION, OURS) if name in found}
    if len(ways) > 1:
        title = "With parts left out, in frames of all three kinds"
        parts += _section(title, _of(ways, "located"), located_row)
    for knob in KNOBS:
        values = {f"{value}": one for value, one in of_knob(found, knob).items()}
        if len(values) > 1:
            parts += _section(f"By {knob}, as mapped", _of(values, "located"), located_row)
    return "\n\n".join(parts)


def of_knob(found: Mapping[str, Any], knob: str) -> dict[int, Any]:
    """By value of one of `KNOBS`, the numbers of frames of all homes as mapped."""
    names = {value: knob_name(knob, value) for value in KNOBS[knob]}
    return {
        value: found[name]["as mapped"][ALL]
        for value, name in names.items()
        if "as mapped" in found.get(name, {})
    }


def located_row(name: str, one: Mapping[str, Any]) -> list[str]:
    """Of `LOCATED_HEADER`, from `scores`."""
    coarse = one["coarse"]
    return [*_tracked_row(name, one), _percent(coarse["far"], one["frames"]), _median(coarse)]


def _tracked_row(name: str, one: Mapping[str, Any]) -> list[str]:
    frames, normalized = one["frames"], one["normalized"]
    return [
        name,
        str(frames),
        *(_percent(one[key], frames) for key in COUNTED),
        _median(one),
        _percent(one["wrong_ok"], frames),
        "-" if normalized is None else f"{normalized:.2f}",
        *("-" if one[key] is None else f"{one[key]:.2f} s" for key in ("s", "cpu_s")),
    ]


def _strange_row(name: str, one: Mapping[str, Any]) -> list[str]:
    return _tracked_row(name, one)[: len(STRANGE_HEADER)]


def _median(offs: Mapping[str, Any]) -> str:
    known = offs["mm"] is not None and offs["deg"] is not None
    return f"{offs['mm']:.1f} mm, {offs['deg']:.2f}°" if known else "-"


def _percent(count: int, of: int) -> str:
    return f"{100 * count / of:.1f} %" if of else "-"


def _of(groups: Mapping[str, Any], what: str) -> dict[str, Any]:
    """Of each group, what was located or what was tracked."""
    return {name: one[what] for name, one in groups.items()}


def _section(title: str, groups: Mapping[str, Any], row: Row) -> list[str]:
    """A title and a table; nothing of nothing."""
    if not groups:
        return []
    return [f"### {title}", table(HEADERS[row], [row(name, one) for name, one in groups.items()])]


HEADERS: dict[Row, tuple[str, ...]] = {
    located_row: LOCATED_HEADER,
    _tracked_row: TRACKED_HEADER,
    _strange_row: STRANGE_HEADER,
}
