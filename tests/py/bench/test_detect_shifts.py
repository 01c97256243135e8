"""Shifted objects: their cases, and the score of what is reported of them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gslts.change.changes import Change
from gslts_bench.detection.cases import Counts, make_cases
from gslts_bench.detection.overlays import choose, file_stem
from gslts_bench.detection.run import Record, Report
from gslts_bench.detection.score import NONE, UNRELIABLE, ShiftScore, is_right
from gslts_bench.detection.shifted import SHIFT_DEG, SHIFT_M
from gslts_bench.detection.tables import summarize, summary, tabulate
from gslts_bench.detection.truth import Truth, as_motion
from gslts_bench.homes import BenchHome, HomeSetup
from gslts_bench.tables import tables_markdown
from gslts_sim.changes import with_carried
from gslts_sim.home import pose
from gslts_sim.task import Change as TrueChange
from gslts_sim.task_viewpoints import FIRST_VIEW_FRACTION

CENTER = (3.0, 2.0, 0.5)
BOX = ((2.6, 1.6, 0.0), (3.4, 2.4, 1.0))


def about_center(dx: float, dy: float, degrees: float) -> np.ndarray:
    """Return the motion of a turn about the middle of the box and a step."""
    x, y, z = CENTER
    there = pose(x + dx, y + dy, z, np.deg2rad(degrees))
    return there @ np.linalg.inv(pose(x, y, z, 0.0))


TRUE = about_center(0.06, -0.02, 5.0)


def shifted(*reports: Report, **others: Any) -> Record:
    change = TrueChange(
        kind="shift", object_id="Chair|1", object_type="Chair", box_before=BOX, box_after=BOX
    )
    truth = Truth(change=change, size_px=3000, motion=as_motion(TRUE))
    facts = {"id": "a", "case": "kitchen_0/a", "part": "shifted", "variant": "objects", "ms": 1.0}
    return Record(**{**facts, **others}, truths=(truth,), reports=reports)


def report(kind: str, motion: np.ndarray | None = None, x: float = CENTER[0]) -> Report:
    point = (x, *CENTER[1:])
    given = None if motion is None else as_motion(motion)
    return Report(kind=kind, confidence=0.9, point_m=point, motion=given)


def test_a_shift_is_right_if_the_centre_comes_to_its_place() -> None:
    exact = ShiftScore.of(shifted(report("shift", TRUE)))
    assert exact.right
    assert (exact.said, exact.extra) == ("shift", 0)
    assert exact.error_m == pytest.approx(0, abs=1e-9)
    near = ShiftScore.of(shifted(report("shift", about_center(0.06, 0.005, 7.0))))
    assert near.right
    assert near.error_m == pytest.approx(0.025, abs=1e-5)
    assert near.error_deg == pytest.approx(2.0, abs=1e-3)
    far = ShiftScore.of(shifted(report("shift", about_center(0.06, 0.015, 5.0))))
    assert not far.right
    assert far.said == "shift"
    elsewhere = ShiftScore.of(shifted(report("shift", TRUE, x=4.1)))
    assert (elsewhere.right, elsewhere.said, elsewhere.extra) == (False, NONE, 1)


def test_other_reports_tell_something_else() -> None:
    both = ShiftScore.of(shifted(report("removal"), report("shift", TRUE)))
    assert (both.right, both.said, both.extra) == (True, "shift", 1)
    beside = report("shift", np.eye(4), x=CENTER[0] + 0.5)
    assert ShiftScore.of(shifted(beside, report("shift", TRUE))).right, "the nearest counts"
    two = ShiftScore.of(shifted(report("removal"), report("addition")))
    assert (two.right, two.said, two.extra) == (False, "removal", 2)
    assert ShiftScore.of(shifted()).said == NONE
    assert ShiftScore.of(shifted(unreliable="black")).said == UNRELIABLE
    assert is_right(shifted(report("shift", TRUE)))
    assert not is_right(shifted(report("shift", TRUE), report("removal")))


def test_a_report_keeps_the_motion() -> None:
    change = Change("shift", 0.8, np.array(CENTER), motion=TRUE)
    kept = Report.model_validate_json(Report.of(change).model_dump_json())
    np.testing.assert_array_equal(kept.motion, TRUE)
    plain = Report.of(Change("removal", 0.8, np.array(CENTER)))
    assert plain.motion is None


def test_the_table_counts_them() -> None:
    removal = TrueChange(
        kind="removal", object_id="Mug|1", object_type="Mug", box_before=BOX, box_after=None
    )
    single = shifted(report("shift", TRUE), part="single").model_copy(
        update={"truths": (Truth(change=removal, size_px=900),)}
    )
    visits = [shifted(*given, part="unchanged") for given in ((report("shift", TRUE),), ())]
    records = [
        shifted(report("shift", TRUE)),
        shifted(report("shift", about_center(0.1, -0.02, 5.0))),
        shifted(report("removal"), report("addition")),
        shifted(),
        shifted(unreliable="black"),
        single,
        *(visit.model_copy(update={"truths": ()}) for visit in visits),
    ]
    records = [
        each.model_copy(update={"case": f"kitchen_0/{number}", "id": str(number)})
        for number, each in enumerate(records)
    ]
    numbers = summary(records, "objects")
    found = numbers["shifted"]
    assert (found["right"], found["wrong_motion"]) == ([1, 5], [1, 5])
    assert (found["removal"], found["addition"]) == ([1, 5], [0, 5])
    assert (found[NONE], found[UNRELIABLE]) == ([1, 5], [1, 5])
    assert found["error_cm"] == pytest.approx(2.0, abs=1e-3)
    assert found["extra_reports"] == [2, 5]
    assert (found["reported_as_shift"], found["visits_with_shifts"]) == ([1, 1], [1, 2])
    assert numbers["single"]["confusion"]["removal"]["shift"] == 1
    assert sum(numbers["calibration"]["reports"]) == 2, "without frames of shifts"
    whole = summarize(records)
    assert "5 shifted objects" in whole["cases"]
    text = tables_markdown(tabulate(whole))
    assert "| reported as a shift, to 3 cm | 20.0 % (1 of 5) | - | - |" in text
    assert "| reported as something else | 20.0 % (1 of 5) | - | - |" in text
    assert "| changes of other parts reported as a shift | 100.0 % (1 of 1) | - | - |" in text
    wrong = choose(records, "objects")
    assert any(each.part == "shifted" for each in wrong)
    assert file_stem(records[0]).endswith("right_shift-Chair_said_1-shift")


@pytest.fixture(scope="module")
def bench() -> BenchHome:
    return BenchHome("kitchen", 3, HomeSetup(), Path("work"))


def test_cases_shift_what_is_seen(bench: BenchHome) -> None:
    made = make_cases(bench, Counts(1, 0, 0, 1, 6))
    cases = [case for case in made.cases if case.part == "shifted"]
    assert [case.name for case in cases] == [f"shifted_{k:02}" for k in range(6)]
    before = bench.default_state(made.initial_actions)
    ids = set()
    for case in cases:
        (truth,), after = case.truths, before.apply_all(case.actions)
        change, motion = truth.change, np.array(truth.motion)
        ids.add(change.object_id)
        for obj in with_carried(before.home, before.home[change.object_id]):
            np.testing.assert_allclose(
                after.home[obj.id].world_from_object, motion @ obj.world_from_object, atol=1e-9
            )
        origin = before.home[change.object_id].world_from_object[:, 3]
        assert SHIFT_M[0] - 1e-3 < np.linalg.norm((motion - np.eye(4)) @ origin) < SHIFT_M[1] + 1e-3
        assert abs(np.rad2deg(np.arctan2(motion[1, 0], motion[0, 0]))) <= SHIFT_DEG + 0.01
        # At another size than that of the search.
        assert truth.size_px >= 0.7 * FIRST_VIEW_FRACTION[0] * 640 * 480
    assert len(ids) == 6


def test_shifts_leave_the_other_cases_as_they_are(bench: BenchHome) -> None:
    some, more = (make_cases(bench, Counts(2, 1, 0, 2, count)).cases for count in (0, 2))
    assert more[: len(some)] == some
    assert {case.part for case in more[len(some) :]} == {"shifted"}
