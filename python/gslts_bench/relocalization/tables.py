"""Numbers and tables of relocalization."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from gslts_bench.relocalization.fold import RoomRecord
from gslts_bench.relocalization.frames import PARTS, Part
from gslts_bench.relocalization.run import Record
from gslts_bench.relocalization.score import MOVED_DEG, MOVED_M, scores
from gslts_bench.relocalization.variants import ABLATION, KNOBS, OURS, knob_name
from gslts_bench.runner import Benchmark
from gslts_bench.tables import Table, number

ALL = "all"
"""Row of all room types."""
OWN: tuple[Part, ...] = ("held-out", "as mapped", "three changes")
"""Parts whose frames are in the map."""
TITLES = {
    "held-out": "Held-out frames of the recording",
    "as mapped": "From anywhere, also in front of bare walls, with the light of a lamp moved",
    "three changes": "After three changes, in view or nearly so",
}
"""Title of the table of each part."""
FOREIGN_HEADER = ("", "frames", "ok", "ambiguous", "lost")
"""Columns of frames of another home."""
TRACKED_HEADER = (
    *FOREIGN_HEADER,
    *("2 cm, 1°", "5 cm, 5°", "median", "wrong `ok`", "error²", "time", "CPU time"),
)
"""Columns of tracked frames. The squared error is in units of the returned covariance, so that it
should be about 1."""
LOCATED_HEADER = (*TRACKED_HEADER, "keypoints alone: 5 cm, 5°", "keypoints alone: median")
"""Columns of localized frames; the last two are of the pose before refinement."""
TRUTHS = {"given": "by the given poses", "corrected": "by poses corrected in a map of all frames"}
"""Rows of a recorded room by field of `RoomRecord`."""

Row = Callable[[str, Mapping[str, Any]], list[str]]


def summarize(records: Iterable[Record]) -> dict[str, Any]:
    """Compute numbers by variant, part and room type.

    Args:
        records: Records without error.

    Returns:
        JSON values; shares as counts. `cases` counts the frames in words.
    """
    records = list(records)
    frames = {(record.part, record.home, record.frame) for record in records}
    counts = {part: sum(own == part for own, _, _ in frames) for part in PARTS}
    homes = len({home for _, home, _ in frames})
    variants = dict.fromkeys(record.variant for record in records)
    return {
        "cases": f"{counts['held-out']} held-out frames, {counts['as mapped']} of homes as mapped, "
        f"{counts['three changes']} after three changes, {counts['another home']} of other homes; "
        f"maps of {homes} home(s)",
        "variants": {
            name: _by_part([record for record in records if record.variant == name])
            for name in variants
        },
    }


def _by_part(records: Sequence[Record]) -> dict[str, Any]:
    own = [record for record in records if record.part in OWN]
    parts = {part: [record for record in records if record.part == part] for part in PARTS}
    numbers: dict[str, Any] = {part: _by_room_type(some) for part, some in parts.items() if some}
    return {**numbers, "own home": _numbers(own)}


def _by_room_type(records: Sequence[Record]) -> dict[str, Any]:
    types = sorted({record.room_type for record in records})
    groups = {name: [record for record in records if record.room_type == name] for name in types}
    return {name: _numbers(some) for name, some in {**groups, ALL: records}.items()}


def _numbers(records: Sequence[Record]) -> dict[str, Any]:
    return {
        "located": scores([record.located for record in records if record.located is not None]),
        "tracked": scores([record.tracked for record in records if record.tracked is not None]),
    }


def tabulate(found: Mapping[str, Any]) -> list[Table]:
    """Make all tables.

    Args:
        found: From `summarize`.
    """
    variants = found["variants"]
    ours = variants.get(OURS, {})
    tables = [_table(TITLES[part], _of(ours.get(part, {}), "located"), located_row) for part in OWN]
    foreign = _of(ours.get("another home", {}), "located")
    tables += [_table("Other homes, which are nowhere in the map", foreign, _foreign_row)]
    for part in OWN:
        title = f"Tracked from {100 * MOVED_M:g} cm and {MOVED_DEG:g}° beside, {part}"
        tables += [_table(title, _of(ours.get(part, {}), "tracked"), _tracked_row)]
    ablation = {name: variants[name]["own home"] for name in (*ABLATION, OURS) if name in variants}
    if len(ablation) > 1:
        title = "With parts left out, in frames of all three kinds"
        tables += [_table(title, _of(ablation, "located"), located_row)]
    for knob in KNOBS:
        values = {f"{value}": numbers for value, numbers in of_knob(found, knob).items()}
        if len(values) > 1:
            tables += [_table(f"By {knob}, as mapped", _of(values, "located"), located_row)]
    return [table for table in tables if table.rows]


BENCHMARK = Benchmark("Relocalization in simulated homes", "localizing", summarize, tabulate)
"""The benchmark of relocalization in homes."""


def summarize_room(records: Iterable[RoomRecord]) -> dict[str, Any]:
    """Compute the numbers of a recorded room.

    Args:
        records: Records without error.

    Returns:
        JSON values; shares as counts.
    """
    records = list(records)
    numbers: dict[str, Any] = {"maps": len({record.fold for record in records})}
    for truth in TRUTHS:
        answers = [getattr(record, truth) for record in records]
        numbers[truth] = scores([answer for answer in answers if answer is not None])
    return numbers


def tabulate_room(found: Mapping[str, Any]) -> list[Table]:
    """Make the table of a recorded room from `summarize_room`.

    Args:
        found: From `summarize_room`.
    """
    rows = [located_row(words, found[truth]) for truth, words in TRUTHS.items()]
    note = f"Each frame in a map made without it; {found['maps']} map(s)."
    return [Table("", LOCATED_HEADER, rows, note)]


ROOM_BENCHMARK = Benchmark(
    "Relocalization in a recorded room", "localizing", summarize_room, tabulate_room
)
"""The benchmark of relocalization in a recorded room."""


def of_knob(found: Mapping[str, Any], knob: str) -> dict[int, Any]:
    """Return the numbers of frames of all homes as mapped, by value of one of `KNOBS`.

    Args:
        found: From `summarize`.
        knob: One of `KNOBS`.
    """
    names = {value: knob_name(knob, value) for value in KNOBS[knob]}
    variants = found["variants"]
    return {
        value: variants[name]["as mapped"][ALL]
        for value, name in names.items()
        if "as mapped" in variants.get(name, {})
    }


def located_row(name: str, numbers: Mapping[str, Any]) -> list[str]:
    """Format a row of `LOCATED_HEADER` from `scores`.

    Args:
        name: Text of the first column.
        numbers: From `scores`.
    """
    coarse = numbers["coarse"]
    far = _percent(coarse["far"], numbers["frames"])
    return [*_tracked_row(name, numbers), far, _median(coarse)]


def _tracked_row(name: str, numbers: Mapping[str, Any]) -> list[str]:
    frames = numbers["frames"]
    return [
        name,
        str(frames),
        *(_percent(numbers[key], frames) for key in ("ok", "ambiguous", "lost", "near", "far")),
        _median(numbers),
        _percent(numbers["wrong_ok"], frames),
        number(numbers["normalized"], 2),
        *(number(numbers[key], 2, "s") for key in ("s", "cpu_s")),
    ]


def _foreign_row(name: str, numbers: Mapping[str, Any]) -> list[str]:
    return _tracked_row(name, numbers)[: len(FOREIGN_HEADER)]


def _median(errors: Mapping[str, Any]) -> str:
    known = errors["mm"] is not None and errors["deg"] is not None
    return f"{errors['mm']:.1f} mm, {errors['deg']:.2f}°" if known else "-"


def _percent(count: int, of: int) -> str:
    return f"{100 * count / of:.1f} %" if of else "-"


def _of(groups: Mapping[str, Any], kind: str) -> dict[str, Any]:
    """Return the numbers located or tracked of each group."""
    return {name: numbers[kind] for name, numbers in groups.items()}


def _table(title: str, groups: Mapping[str, Any], row: Row) -> Table:
    return Table(title, HEADERS[row], [row(name, numbers) for name, numbers in groups.items()])


HEADERS: dict[Row, tuple[str, ...]] = {
    located_row: LOCATED_HEADER,
    _tracked_row: TRACKED_HEADER,
    _foreign_row: FOREIGN_HEADER,
}
"""Header by formatter of a row."""
