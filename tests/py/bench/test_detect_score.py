"""Scores of reports of changes: each rule has a report that passes it and one that fails."""

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from gslts_bench.detection.run import Record, Report
from gslts_bench.detection.score import (
    NONE,
    REGION_M,
    UNRELIABLE,
    Calibration,
    SeveralScore,
    SingleScore,
    count_matches,
    is_right,
    size_name,
)
from gslts_bench.detection.tables import confusion, summarize, summary, tabulate
from gslts_bench.detection.truth import Truth
from gslts_bench.detection.variants import STRATEGIES, TRADE
from gslts_bench.tables import tables_markdown
from gslts_sim.task import Change

BEFORE, AFTER = (1.0, 2.0, 0.5), (4.0, 2.0, 0.5)
"""Middles of the boxes."""


def box(middle: tuple[float, ...], half: float = 0.8) -> tuple[tuple[float, ...], ...]:
    """Large, so that the distance of its side is another one than that of its middle."""
    low, high = np.array(middle) - half, np.array(middle) + half
    return tuple(low.tolist()), tuple(high.tolist())


def truth(kind: str, size_px: int = 1000, name: str = "Mug|1", shift: float = 0.0) -> Truth:
    before, after = ((x + shift, y, z) for x, y, z in (BEFORE, AFTER))
    change = Change(
        kind=kind,
        object_id=name,
        object_type=name.split("|")[0],
        box_before=None if kind == "addition" else box(before),
        box_after=None if kind == "removal" else box(after),
    )
    return Truth(change=change, size_px=size_px)


def report(kind: str, point: tuple[float, ...], confidence: float = 0.9) -> Report:
    return Report(kind=kind, confidence=confidence, point_m=point)


def record(truths: list[Truth], reports: list[Report], **others: Any) -> Record:
    part = {0: "unchanged", 1: "single", 2: "pair", 3: "triple"}[len(truths)]
    facts = {"id": "a", "case": "kitchen_0/a", "part": part, "variant": "objects", "ms": 1.0}
    return Record(**{**facts, **others}, truths=tuple(truths), reports=tuple(reports))


def single(kind: str, *reports: Report, **others: Any) -> SingleScore:
    return SingleScore.of(record([truth(kind)], list(reports), **others))


@pytest.mark.parametrize("way", [(1, 0, 0), (0, -1, 0), (0, 0, 1), (0.6, 0, 0.8)])
@pytest.mark.parametrize(("metres", "right"), [(REGION_M - 0.01, True), (REGION_M + 0.01, False)])
def test_the_region_ends_a_metre_from_the_middle(
    way: tuple[float, ...], metres: float, right: bool
) -> None:
    point = tuple((np.array(BEFORE) + metres * np.array(way)).tolist())
    score = single("removal", report("removal", point))
    assert (score.right, score.region, score.found) == (right, right, right)
    assert score.said == "removal", "the type is right wherever it is said to be"
    assert score.extra == (0 if right else 1)


def test_a_relocation_is_where_the_object_was_and_where_it_is() -> None:
    for point, right in ((BEFORE, True), (AFTER, True), ((2.5, 2.0, 0.5), False)):
        assert single("relocation", report("relocation", point)).right == right
    assert not single("removal", report("removal", AFTER)).right
    assert not single("addition", report("addition", BEFORE)).right


def test_another_type_is_wrong() -> None:
    score = single("removal", report("addition", BEFORE))
    assert (score.right, score.region, score.found) == (False, True, False)
    assert (score.said, score.extra) == ("addition", 1)


def test_the_most_confident_report_counts() -> None:
    wrong, right = report("addition", BEFORE, 0.9), report("removal", BEFORE, 0.8)
    score = single("removal", wrong, right)
    assert (score.right, score.found, score.said, score.extra) == (False, True, "addition", 1)
    assert single("removal", right, wrong).right
    twice = single("removal", right, right)
    assert (twice.right, twice.extra) == (True, 1), "one change is reported once"


def test_no_report_is_none_or_unreliable() -> None:
    assert single("removal").said == NONE
    silent = single("removal", unreliable="the image is black")
    assert (silent.said, silent.right, silent.found, silent.extra) == (UNRELIABLE, False, False, 0)


def test_each_report_tells_one_change() -> None:
    changes = [truth("removal").change, truth("removal", shift=1.2).change]
    between, left = (1.6, 2.0, 0.5), BEFORE
    assert count_matches([report("removal", between)], changes) == 1
    assert count_matches([report("removal", between), report("removal", between)], changes) == 2
    # The first report fits both, the second only the first: it must not be taken away from it.
    assert count_matches([report("removal", between), report("removal", left)], changes) == 2
    assert count_matches([report("removal", left), report("removal", left)], changes) == 1
    assert count_matches([report("addition", between)] * 2, changes) == 0
    assert count_matches([], changes) == count_matches([report("removal", left)], []) == 0


def test_several_changes_are_found_one_by_one() -> None:
    truths = [truth("removal"), truth("addition", name="Cup|1")]
    both = [report("addition", AFTER), report("removal", BEFORE)]
    records = [
        record(truths, [*both, report("removal", AFTER)]),
        record([*truths, truth("relocation", name="Pan|1", shift=9)], both[:1]),
        record(truths, [], unreliable="blurred"),
    ]
    assert SeveralScore.of(records) == SeveralScore(changes=7, found=3, false=1, frames=3)
    assert is_right(record(truths, both))
    assert not is_right(records[0]), "a change that did not happen was reported"
    assert not is_right(records[1])


def test_an_unchanged_home_is_right_without_reports() -> None:
    assert is_right(record([], []))
    assert not is_right(record([], [report("removal", BEFORE)]))


@pytest.mark.parametrize(
    ("size_px", "name"),
    [
        (0, "below 500 px"),
        (499, "below 500 px"),
        (500, "500 to 2000 px"),
        (7999, "2000 to 8000 px"),
        (8000, "from 8000 px"),
    ],
)
def test_sizes_fall_into_rows(size_px: int, name: str) -> None:
    assert size_name(size_px) == name


def test_the_confusion_is_by_true_type() -> None:
    scores = [
        single("removal", report("removal", AFTER)),
        single("removal", report("addition", BEFORE)),
        single("addition"),
        single("addition", unreliable="blurred"),
    ]
    counts = confusion(scores)
    assert counts["removal"] == {
        "addition": 1,
        "removal": 1,
        "relocation": 0,
        "shift": 0,
        NONE: 0,
        UNRELIABLE: 0,
    }
    assert (counts["addition"][NONE], counts["addition"][UNRELIABLE]) == (1, 1)
    assert sum(counts["relocation"].values()) == 0


def many_records() -> list[Record]:
    hit, miss = report("removal", BEFORE), report("removal", AFTER)
    others = [truth("addition", name="Cup|1"), truth("relocation", name="Pan|1", shift=9)]
    records = [
        record([truth("removal", 400)], [hit], ms=10.0),
        record([truth("removal", 9000)], [miss], ms=30.0),
        record([truth("removal", 600)], [], ms=80.0, unreliable="blurred"),
        record([truth("removal"), others[0]], [hit]),
        record([truth("removal"), *others], [hit, report("addition", AFTER)]),
        record([], [], unreliable="black"),
        record([], [miss, hit]),
    ]
    return [
        record.model_copy(update={"case": f"kitchen_{number % 2}/{number}", "id": str(number)})
        for number, record in enumerate(records)
    ]


def test_numbers_are_those_of_one_detector() -> None:
    records = many_records()
    of_gs_lts = [
        record.model_copy(update={"variant": "gs_lts", "reports": ()}) for record in records
    ]
    numbers = summary([*of_gs_lts, *records], "objects")
    single = numbers["single"]
    assert (single["right"], single["type"], single["region"]) == ([1, 3], [2, 3], [1, 3])
    assert (single["found"], single["unreliable"], single["extra_reports"]) == (
        [1, 3],
        [1, 3],
        [1, 3],
    )
    assert single["by_size"] == {
        "below 500 px": [1, 1],
        "500 to 2000 px": [0, 1],
        "2000 to 8000 px": [0, 0],
        "from 8000 px": [0, 1],
    }
    assert single["by_type"]["removal"] == [1, 3]
    assert single["by_object"] == {"Mug": [1, 3]}
    assert single["confusion_by_size"]["from 8000 px"]["removal"]["removal"] == 1
    assert numbers["pair"] == {"found": [1, 2], "false_reports": [0, 1]}
    assert numbers["triple"] == {"found": [2, 3], "false_reports": [0, 1]}
    assert numbers["unchanged"] == {"with_reports": [1, 2], "unreliable": [1, 2]}
    assert numbers["ms"]["single"] == 30.0
    assert summary(of_gs_lts, "gs_lts")["single"]["right"] == [0, 3]


def test_tables_tell_them() -> None:
    records = many_records()
    found = summarize(records)
    text = tables_markdown(tabulate(found))
    assert "| one change: type and region right | 33.3 % (1 of 3) | - | - | 95 % |" in text
    assert "| two and three changes: found | 60.0 % (3 of 5) | - | - | 80 % |" in text
    assert "| no change: visits with reports | 1 of 2 | 0 of 0 | 0 of 0 | 1 of 200 |" in text
    assert "| removal, all | 0 | 2 | 0 | 0 | 0 | 1 |" in text
    assert "| removal, below 500 px | 0 | 1 | 0 | 0 | 0 | 0 |" in text
    assert "Speed" not in text
    lines = [line for line in text.splitlines() if line.startswith("|")]
    for above, below in pairwise(lines):
        if below.startswith("| :--"):
            assert above.count("|") == below.count("|")
    both = {"detectors": {name: summary(records, name) for name in (*STRATEGIES, *TRADE)}}
    assert "| full, gradients | - |" in tables_markdown(tabulate(both))
    assert found["cases"].startswith("3 single changes, 1 pairs, 1 triples, 2 visits")


def test_calibration_compares_confidence_with_the_share_of_true_reports() -> None:
    true, false = report("removal", BEFORE, 0.95), report("addition", BEFORE, 0.55)
    records = [record([truth("removal")], [true, false])] * 2
    records += [record([], [report("removal", BEFORE, 1.0)]), record([truth("removal")], [])]
    found = Calibration.of(records)
    assert found.reports == (0, 2, 0, 0, 0, 3)
    assert found.true == (0, 0, 0, 0, 0, 2)
    assert found.confidence == pytest.approx((0, 1.1, 0, 0, 0, 2.9))
    assert found.error == pytest.approx((1.1 + 0.9) / 5)


def test_calibration_of_no_report_is_unknown() -> None:
    assert Calibration.of([record([truth("removal")], [])]).error is None
