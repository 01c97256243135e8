"""Scores of relocalization: errors, shares and tables, by hand."""

import numpy as np
import pytest

from gslts.core.se3 import rotation
from gslts.localization.config import RelocalizationConfig
from gslts.localization.relocalizer import Localization
from gslts_bench.relocalization.fold import RoomRecord
from gslts_bench.relocalization.run import Record
from gslts_bench.relocalization.score import (
    MOVED_DEG,
    MOVED_M,
    Answer,
    PoseError,
    TimedAnswer,
    normalized_error,
    scores,
    start_near,
)
from gslts_bench.relocalization.tables import (
    ALL,
    of_knob,
    summarize,
    summarize_room,
    tabulate,
    tabulate_room,
)
from gslts_bench.relocalization.variants import ABLATION, KNOBS, OURS, TRADE, VARIANTS, knob_name
from gslts_bench.tables import tables_markdown


def pose(x_m: float = 0.0, yaw_deg: float = 0.0) -> np.ndarray:
    result = np.eye(4)
    result[0, 3], result[:3, :3] = x_m, rotation(np.deg2rad([0, 0, yaw_deg]))
    return result


def answer(m: float, deg: float = 0.5, **more: object) -> Answer:
    return Answer(status="ok", off=PoseError(m=m, deg=deg), **more)


def record(name: str, located: Answer, **more: object) -> Record:
    known = {"home": "kitchen_3", "room_type": "kitchen", "part": "as mapped", "variant": OURS}
    given = {**known, **more}
    return Record(id=f"{name}: {given['variant']}", frame=name, located=located, **given)


RECORDS = [
    record("kitchen_3/visit_00", answer(0.01, normalized=2.0), tracked=answer(0.03)),
    record("kitchen_3/visit_01", answer(0.04, normalized=4.0), tracked=Answer(status="lost")),
    record("kitchen_3/visit_02", answer(0.5, normalized=900.0)),
    record("kitchen_3/visit_03", Answer(status="lost", reason="dark")),
    record("kitchen_3/changed_00", answer(0.02, 0.9), part="three changes"),
    record("bedroom_3/visit_00", Answer(status="ambiguous"), part="another home"),
    record("kitchen_3/visit_00", answer(0.02, cpu_s=0.5), variant="keypoints = 250"),
]


def test_the_error_of_a_pose() -> None:
    off = PoseError.of(pose(0.03, 20), pose(0.0, 17))
    assert (off.m, off.deg) == pytest.approx((0.03, 3))
    assert off.within(0.031, 3.1)
    assert not off.within(0.029, 3.1)
    assert not off.within(0.031, 2.9)
    assert PoseError.of(pose(), pose(0, 180)).deg == pytest.approx(180)


def test_errors_in_units_of_the_covariance() -> None:
    true, found = pose(0.02, 30), pose(0.0, 30)
    covariance = np.diag([0.01**2] * 3 + [0.005**2] * 3)
    assert normalized_error(found, covariance, true) == pytest.approx(2**2 / 6)
    true = found @ pose(0, np.rad2deg(0.01))
    assert normalized_error(found, covariance, true) == pytest.approx(2**2 / 6)


def test_covariances_that_are_right_give_one() -> None:
    rng = np.random.default_rng(0)
    root = rng.normal(scale=0.01, size=(6, 6))
    errors = []
    for twist in rng.normal(size=(4000, 6)) @ root.T:
        motion = np.eye(4)
        motion[:3, :3], motion[:3, 3] = rotation(twist[3:]), twist[:3]
        errors.append(normalized_error(pose(1, 40), root @ root.T, pose(1, 40) @ motion))
    assert np.mean(errors) == pytest.approx(1, abs=0.05)


def test_tracking_starts_so_far_from_the_truth() -> None:
    starts = [start_near(pose(1, 70), np.random.default_rng(seed)) for seed in (0, 0, 1)]
    for start in starts:
        off = PoseError.of(start, pose(1, 70))
        assert (off.m, off.deg) == pytest.approx((MOVED_M, MOVED_DEG))
    np.testing.assert_array_equal(starts[0], starts[1])
    assert np.abs(starts[0] - starts[2]).max() > 1e-3


def test_answers_are_judged_by_the_true_pose() -> None:
    found = Localization(
        status="ok",
        reason="",
        world_from_camera=pose(0.01),
        covariance=np.eye(6) * 1e-4,
        inliers=40,
        coarse=pose(0.03),
    )
    timed = TimedAnswer.of(lambda: found)
    assert timed.s >= 0
    judged = timed.judge(pose())
    assert (judged.status, judged.inliers) == ("ok", 40)
    assert judged.off is not None
    assert judged.coarse is not None
    assert (judged.off.m, judged.coarse.m) == pytest.approx((0.01, 0.03))
    assert judged.normalized == pytest.approx(1 / 6)
    strange = timed.judge(None)
    assert (strange.status, strange.off, strange.normalized) == ("ok", None, None)
    lost = TimedAnswer(Localization(status="lost", reason="dark"), 0.1, 0.1).judge(pose())
    assert (lost.status, lost.reason, lost.off, lost.coarse) == ("lost", "dark", None, None)


def test_lost_frames_are_infinitely_far() -> None:
    answers = [record.located for record in RECORDS[:4] if record.located is not None]
    found = scores(answers)
    assert {key: found[key] for key in ("frames", "ok", "ambiguous", "lost")} == {
        "frames": 4,
        "ok": 3,
        "ambiguous": 0,
        "lost": 1,
    }
    assert (found["near"], found["far"], found["wrong_ok"]) == (1, 2, 1)
    assert found["mm"] == pytest.approx((40 + 500) / 2), "of four, one at infinity"
    assert found["normalized"] == pytest.approx(3.0), "of those that are right"
    assert scores(answers[3:])["mm"] is None
    assert scores([])["s"] is None


def test_the_summary_counts_each_part_by_itself() -> None:
    numbers = summarize(RECORDS)
    found = numbers["variants"]
    assert found[OURS]["as mapped"]["kitchen"]["located"]["frames"] == 4
    assert found[OURS]["three changes"][ALL]["located"]["near"] == 1
    assert found[OURS]["own home"]["located"]["frames"] == 5
    assert found[OURS]["another home"][ALL]["located"]["ambiguous"] == 1
    tracked = found[OURS]["as mapped"][ALL]["tracked"]
    assert (tracked["frames"], tracked["lost"], tracked["far"]) == (2, 1, 1)
    assert of_knob(numbers, "keypoints")[250]["located"]["cpu_s"] == 0.5
    assert numbers["cases"] == (
        "0 held-out frames, 4 of homes as mapped, 1 after three changes, 1 of other homes; "
        "maps of 1 home(s)"
    )


def test_tables() -> None:
    text = tables_markdown(tabulate(summarize(RECORDS)))
    shares = (
        "| kitchen | 4 | 75.0 % | 0.0 % | 25.0 % | 25.0 % | 50.0 % | 270.0 mm, 0.50° | 25.0 % |"
    )
    assert f"{shares} 3.00 |" in text
    assert "\n| all | 1 | 0.0 % | 100.0 % | 0.0 % |\n" in text + "\n"
    assert "### Tracked from 5 cm and 2° beside, as mapped" in text
    assert "### By keypoints, as mapped" in text
    assert "### With parts left out" not in text
    for line in text.splitlines():
        assert line.count("|") in (0, 6, 13, 15)
    assert tabulate(summarize([])) == []


def test_frames_of_a_room_are_judged_twice() -> None:
    records = [
        RoomRecord(id="a", fold=1, given=answer(0.04), corrected=answer(0.01)),
        RoomRecord(id="b", fold=2, given=answer(0.06), corrected=answer(0.015)),
    ]
    found = summarize_room(records)
    assert found["maps"] == 2
    assert (found["given"]["far"], found["corrected"]["near"]) == (1, 2)
    text = tables_markdown(tabulate_room(found))
    assert "| by the given poses | 2 | 100.0 % |" in text
    assert "50.0 mm, 0.50°" in text
    assert "12.5 mm, 0.50°" in text


def test_the_default_is_one_of_each_knob() -> None:
    default = RelocalizationConfig()
    for knob, values in KNOBS.items():
        assert knob_name(knob, getattr(default, knob)) == OURS
        assert getattr(default, knob) in values
        for value in values:
            assert getattr(VARIANTS[knob_name(knob, value)], knob) == value
    assert set(VARIANTS) == {OURS, *ABLATION, *TRADE}
    assert all(config.threads == 1 for config in VARIANTS.values())
    assert len(TRADE) == sum(map(len, KNOBS.values())) - len(KNOBS)
