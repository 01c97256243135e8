"""`gslts bench relocalize` as a user meets it, in one small home, and the frames it asks about."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bench_settings import SETTINGS
from command import gslts
from PIL import Image

from gslts.bench.homes import BenchHome, HomeSetup
from gslts.bench.relocalize import folds_of
from gslts.bench.relocalize_frames import (
    LOOKS,
    NEAR_DEG,
    NEAR_M,
    Batch,
    cases_of,
    look_near,
    other_homes,
)
from gslts.bench.relocalize_room import FOLDS, RecordedRoom, brought_to, content_of
from gslts.bench.relocalize_variants import ABLATION, OURS, TRADE
from gslts.camera import rotation
from gslts.mapping.config import MappingConfig
from gslts.sim import make_home
from gslts.sim.robot_body import Look, floor_of

SMALL = ("--room", "bedroom", "--seeds", "3:4", "--size", "240x180", "--frames", "32")
MAPPED = (*SETTINGS, "--set", "voxel_m=0.05", "--work", "work")
RUN = ("bench", "relocalize", *SMALL, *MAPPED, "--views", "4", "--ablation", "--trade", "t.png")
BENCH = BenchHome(
    "bedroom", 3, HomeSetup(frames=16, width=160, height=120, code={"sim": 0}), Path()
)


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder in which the benchmark ran."""
    folder = tmp_path_factory.mktemp("bench")
    process = gslts(*RUN, "--json", "all.json", cwd=folder)
    assert process.returncode == 0, process.stderr
    (folder / "stdout").write_text(process.stdout)
    return folder


def records(path: Path) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = json.loads(path.read_text())["records"]
    return found


def test_each_frame_is_asked_about_in_each_way(done: Path) -> None:
    asked: dict[tuple[str, str], set[str]] = {}
    for one in records(done / "all.json"):
        asked.setdefault((one["part"], one["frame"]), set()).add(one["variant"])
    expected = {
        "kept aside": {OURS, *ABLATION},
        "as mapped": {OURS, *ABLATION, *TRADE},
        "three changes": {OURS, *ABLATION},
        "another home": {OURS},
    }
    for (part, _), variants in asked.items():
        assert variants == expected[part]
    names = {part: sorted(name for own, name in asked if own == part) for part in expected}
    assert names["kept aside"] == [f"bedroom_3/kept_{k:05}" for k in range(0, 32, 8)]
    assert names["as mapped"] == [f"bedroom_3/visit_{k:02}" for k in range(4)]
    assert names["three changes"] == [f"bedroom_3/changed_{k:02}" for k in range(4)]
    assert names["another home"] == [f"{home}/visit_0{k}" for home in STRANGERS for k in range(2)]


STRANGERS = ("bedroom_2", "kitchen_3")


def test_only_frames_of_the_home_are_judged_by_a_true_pose(done: Path) -> None:
    for one in records(done / "all.json"):
        located, own = one["located"], one["part"] != "another home"
        assert located["s"] > 0
        assert (located["off"] is not None) == (own and located["status"] != "lost")
        assert (one["tracked"] is not None) == (own and one["variant"] == OURS)
        if not own:
            assert located["status"] != "ok"


def test_frames_are_found_even_in_a_rough_map(done: Path) -> None:
    ours = json.loads((done / "all.json").read_text())["summary"][OURS]["own home"]
    assert ours["located"]["far"] >= 4
    assert ours["tracked"]["far"] >= 4


def test_tables_and_picture(done: Path) -> None:
    text = (done / "stdout").read_text()
    assert (
        "4 frames kept aside, 4 of homes as mapped, 4 after three changes, 4 of other homes" in text
    )
    assert text.count("\n| bedroom | 4 |") == 7
    assert text.count("\n| without depth | 12 |") == 1
    with Image.open(done / "t.png") as picture:
        assert picture.size[0] > 900


def test_an_interrupted_run_goes_on(done: Path) -> None:
    (path,) = (done / "work" / "relocalize").glob("bedroom_3_*.jsonl")
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines[:-2]) + lines[-2][:40])
    maps = sorted((done / "work" / "maps").iterdir())
    process = gslts(*RUN, "--json", "again.json", cwd=done)
    assert process.returncode == 0, process.stderr
    before, after = records(done / "all.json"), records(done / "again.json")
    assert before[:-2] == after[:-2]
    for one, other in zip(before[-2:], after[-2:], strict=True):
        assert timeless(one) == timeless(other), "the same but for the times"
    assert sorted((done / "work" / "maps").iterdir()) == maps


def test_frames_kept_aside_are_those_that_the_map_was_made_without(done: Path) -> None:
    (map_cameras,) = (done / "work" / "maps").glob("bedroom_3_*/cameras.json")
    kept = {one["frame"] for one in records(done / "all.json") if one["part"] == "kept aside"}
    assert not {one.partition("kept_")[2] for one in kept} & set(
        json.loads(map_cameras.read_text())
    )


def timeless(record: dict[str, Any]) -> dict[str, Any]:
    located = {**record["located"], "s": 0, "cpu_s": 0}
    tracked = record["tracked"] and {**record["tracked"], "s": 0, "cpu_s": 0}
    return {**record, "located": located, "tracked": tracked}


def test_a_recorded_room(done: Path) -> None:
    """The recording of the home is a data set like any other."""
    (recording,) = (done / "work" / "recordings").glob("bedroom_3_*")
    run = ("bench", "relocalize", "--real", recording, "--fold", "1", *MAPPED)
    process = gslts(*run, "--json", "room.json", cwd=done)
    assert process.returncode == 0, process.stderr
    found = records(done / "room.json")
    assert [one["id"] for one in found] == [f"{k:05}" for k in range(1, 32, FOLDS)]
    content = json.loads((done / "room.json").read_text())
    assert content["errors"] == {}
    assert content["room"]["corrected"]["far"] >= 2
    assert content["room"]["given"]["far"] >= 2
    (made_of,) = (done / "work" / "maps").glob("*_without_1_*/cameras.json")
    assert not set(json.loads(made_of.read_text())) & {one["id"] for one in found}
    assert "| by the given poses | 4 |" in process.stdout
    again = gslts(*run, cwd=done)
    assert again.stdout == process.stdout, "the same table, to the last time"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--fold", "1"), "--fold is for --real"),
        (("--real", ".", "--ablation"), "--ablation and --trade are for homes"),
        (("--real", "nowhere"), "there is no such file"),
    ],
)
def test_what_does_not_fit_together(
    tmp_path: Path, arguments: tuple[str, ...], message: str
) -> None:
    process = gslts("bench", "relocalize", *arguments, cwd=tmp_path)
    assert process.returncode != 0
    assert message in process.stderr
    assert len(process.stderr.splitlines()) == 1


def test_folds_are_eight() -> None:
    room = RecordedRoom(Path("room"), "0", MappingConfig(), Path(), {})
    assert [one.fold for one in folds_of(room, [])] == list(range(8))
    assert [one.fold for one in folds_of(room, [5, 2, 5])] == [2, 5]
    assert len({one.results for one in folds_of(room, [])}) == 8
    other = replace(room, content="1")
    assert folds_of(other, [2])[0].results != folds_of(room, [2])[0].results
    with pytest.raises(ValueError, match="0 to 7, got 8"):
        folds_of(room, [8])


def test_another_file_is_another_room(tmp_path: Path) -> None:
    (tmp_path / "frames").mkdir()
    (tmp_path / "frames" / "a").write_text("1")
    seen = {content_of(tmp_path), content_of(tmp_path / "frames" / "a")}
    (tmp_path / "frames" / "a").write_text("2")
    seen.add(content_of(tmp_path))
    (tmp_path / "frames" / "a").rename(tmp_path / "frames" / "b")
    seen.add(content_of(tmp_path))
    assert len(seen) == 4


def test_two_maps_are_brought_together() -> None:
    rng = np.random.default_rng(0)
    known = {f"{k}": _pose(rng.normal(size=3), rng.normal(size=3)) for k in range(5)}
    motion = _pose(np.array([0.3, -0.1, 0.2]), np.array([0.02, 0.01, -0.03]))
    poses = {name: motion @ one for name, one in known.items()}
    brought = brought_to(poses, {name: known[name] for name in ("0", "1", "3")})
    assert list(brought) == list(poses)
    for name, one in brought.items():
        np.testing.assert_allclose(one, known[name], atol=1e-9)
    with pytest.raises(ValueError, match="no frame in common"):
        brought_to(poses, {"other": np.eye(4)})


def test_other_homes_are_of_another_type_and_of_the_same() -> None:
    assert [one.name for one in other_homes(BENCH)] == ["kitchen_3", "bedroom_2"]
    last, first = (other_homes(replace(BENCH, seed=seed)) for seed in (9999, 10000))
    assert (last[1].seed, first[1].seed) == (9998, 10001), "kept apart from those of evaluation"


def test_looks_nearby_are_from_where_a_robot_can_stand() -> None:
    home, rng = make_home("bedroom", 3, detail=0.05), np.random.default_rng(0)
    floor = floor_of(home)
    look = Look(floor.places(0.25)[7], 350.0, 20.0)
    looks = [look_near(look, home, rng) for _ in range(20)]
    for one in looks:
        assert floor.can_stand(one.place)
        assert np.abs(one.place - look.place).max() <= NEAR_M
        assert abs((one.yaw_deg - look.yaw_deg + 180) % 360 - 180) <= NEAR_DEG + 0.1
        assert one.horizon_deg == 20
    assert len({one.yaw_deg for one in looks}) > 10


def test_more_visits_begin_with_the_same_ones() -> None:
    few, more = cases_of(BENCH, 3, 0), cases_of(BENCH, 5, 0)
    assert few.cases == more.cases[:3]
    assert few.initial_actions == more.initial_actions
    grid = floor_of(Batch(BENCH, few, strange=False).before().home).places(0.25)
    for case in more.cases:
        place = case.viewpoint.look.place
        assert np.linalg.norm(grid - place, axis=1).min() > 1e-6, "the recording's are on a grid"


def test_changes_are_looked_at_from_several_places() -> None:
    found = cases_of(BENCH, 0, LOOKS + 1)
    assert [one.name for one in found.cases] == [f"changed_{k:02}" for k in range(LOOKS + 1)]
    first, last = found.cases[:LOOKS], found.cases[LOOKS]
    assert {one.actions for one in first} == {first[0].actions}
    assert last.actions != first[0].actions
    assert len({one.viewpoint for one in found.cases}) == LOOKS + 1
    assert all(len(one.truths) == 3 for one in found.cases)
    batch = Batch(BENCH, found, strange=False)
    assert {batch.part(one) for one in found.cases} == {"three changes"}
    frame, true = batch.look(first[1], batch.before())
    off_m = np.linalg.norm(frame.camera.world_from_camera[:3, 3] - true[:3, 3])
    assert 0 < off_m < 0.05, "what the robot believes errs, what judges it does not"


def _pose(place: np.ndarray, turn: np.ndarray) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation(turn), place
    return pose
