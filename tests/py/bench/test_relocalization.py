"""Frames of `gslts bench relocalize`."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from store_maps import random_map

from gslts.core.camera import camera_from_fov
from gslts.core.se3 import rotation
from gslts.mapping.config import MappingConfig
from gslts.mapping.frames import split_held_out
from gslts.store.map_folder import write_map_folder
from gslts_bench.homes import BenchHome, HomeSetup
from gslts_bench.relocalization import views
from gslts_bench.relocalization.fold import units_of
from gslts_bench.relocalization.frames import (
    MAX_OFFSET_M,
    MAX_TURN_DEG,
    VIEWS_PER_SET,
    Batch,
    draw_viewpoint_near,
    make_cases,
    other_homes,
)
from gslts_bench.relocalization.room import RecordedRoom, content_digest, transfer
from gslts_sim import make_home
from gslts_sim.robot_body import Viewpoint
from gslts_sim.walkable import floor_of

BENCH = BenchHome(
    "bedroom", 3, HomeSetup(frames=16, width=160, height=120, code={"sim": 0}), Path()
)


def test_folds_are_eight() -> None:
    room = RecordedRoom(Path("room"), "0", MappingConfig(), Path(), {})
    assert [unit.bench.fold for unit in units_of(room, [])] == list(range(8))
    assert [unit.bench.fold for unit in units_of(room, [5, 2, 5])] == [2, 5]
    assert len({unit.results for unit in units_of(room, [])}) == 8
    other = replace(room, content="1")
    assert units_of(other, [2])[0].results != units_of(room, [2])[0].results
    with pytest.raises(ValueError, match="0 to 7, got 8"):
        units_of(room, [8])


def test_another_file_is_another_room(tmp_path: Path) -> None:
    (tmp_path / "frames").mkdir()
    (tmp_path / "frames" / "a").write_text("1")
    seen = {content_digest(tmp_path), content_digest(tmp_path / "frames" / "a")}
    (tmp_path / "frames" / "a").write_text("2")
    seen.add(content_digest(tmp_path))
    (tmp_path / "frames" / "a").rename(tmp_path / "frames" / "b")
    seen.add(content_digest(tmp_path))
    assert len(seen) == 4


def test_two_maps_are_brought_together() -> None:
    rng = np.random.default_rng(0)
    known = {f"{k}": _pose(rng.normal(size=3), rng.normal(size=3)) for k in range(5)}
    motion = _pose(np.array([0.3, -0.1, 0.2]), np.array([0.02, 0.01, -0.03]))
    poses = {name: motion @ pose for name, pose in known.items()}
    brought = transfer(poses, {name: known[name] for name in ("0", "1", "3")})
    assert list(brought) == list(poses)
    for name, pose in brought.items():
        np.testing.assert_allclose(pose, known[name], atol=1e-9)
    with pytest.raises(ValueError, match="no frame in common"):
        transfer(poses, {"other": np.eye(4)})


def test_other_homes_are_of_another_type_and_of_the_same() -> None:
    assert [home.name for home in other_homes(BENCH)] == ["kitchen_3", "bedroom_2"]
    last, first = (other_homes(replace(BENCH, seed=seed)) for seed in (9999, 10000))
    assert (last[1].seed, first[1].seed) == (9998, 10001), "in the same split"


def test_other_homes_of_a_flat_are_none_of_its_rooms() -> None:
    flat = replace(BENCH, room_type="flat")
    assert [home.name for home in other_homes(flat)] == ["kitchen_2", "flat_2"]


def test_held_out_frames_are_the_test_frames_of_the_map(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = [f"{k:05}" for k in range(20)]
    validation, test = split_held_out(names)
    trained = [name for k, name in enumerate(names) if k not in {*validation, *test}]
    camera = camera_from_fov(4, 4, 1.0, np.eye(4))
    manifest = {"validation_frames": [names[k] for k in validation]}
    write_map_folder(tmp_path / "map", random_map(5), manifest, dict.fromkeys(trained, camera))
    frames = tuple(SimpleNamespace(name=name) for name in names)
    monkeypatch.setattr(BenchHome, "recording", lambda _: tmp_path)
    monkeypatch.setattr(BenchHome, "map", lambda _: tmp_path / "map")
    monkeypatch.setattr(views, "open_dataset", lambda _: SimpleNamespace(frames=frames))
    monkeypatch.setattr(views, "true_poses", lambda _: dict.fromkeys(names))
    monkeypatch.setattr(views, "batches_of", lambda _bench, _count: ())
    found = [view.frame for view in views.views_of(BENCH, 60)]
    assert found == [f"bedroom_3/kept_{names[k]}" for k in test]
    assert [view.frame for view in views.views_of(BENCH, 1)] == found[:1]


def test_viewpoints_nearby_are_reachable() -> None:
    home, rng = make_home("bedroom", 3, detail=0.05), np.random.default_rng(0)
    floor = floor_of(home)
    viewpoint = Viewpoint.at(floor.grid_positions(0.25)[7], 350.0, 20.0)
    viewpoints = [draw_viewpoint_near(viewpoint, home, rng) for _ in range(20)]
    for near in viewpoints:
        assert floor.can_stand(near.position)
        assert np.abs(near.position - viewpoint.position).max() <= MAX_OFFSET_M
        assert abs((near.yaw_deg - viewpoint.yaw_deg + 180) % 360 - 180) <= MAX_TURN_DEG + 0.1
        assert near.horizon_deg == 20
    assert len({near.yaw_deg for near in viewpoints}) > 10


def test_more_visits_begin_with_the_same_ones() -> None:
    few, more = make_cases(BENCH, 3, 0), make_cases(BENCH, 5, 0)
    assert few.cases == more.cases[:3]
    assert few.initial_actions == more.initial_actions
    grid = floor_of(Batch(BENCH, few, foreign=False).before().home).grid_positions(0.25)
    for case in more.cases:
        place = case.viewpoint.position
        assert np.linalg.norm(grid - place, axis=1).min() > 1e-6, "recorded from a grid"


def test_changes_have_several_viewpoints() -> None:
    found = make_cases(BENCH, 0, VIEWS_PER_SET + 1)
    assert [case.name for case in found.cases] == [
        f"changed_{k:02}" for k in range(VIEWS_PER_SET + 1)
    ]
    first, last = found.cases[:VIEWS_PER_SET], found.cases[VIEWS_PER_SET]
    assert {case.actions for case in first} == {first[0].actions}
    assert last.actions != first[0].actions
    assert len({case.viewpoint for case in found.cases}) == VIEWS_PER_SET + 1
    assert all(len(case.truths) == 3 for case in found.cases)
    batch = Batch(BENCH, found, foreign=False)
    assert {batch.part(case) for case in found.cases} == {"three changes"}
    frame, true = batch.take(first[1], batch.before())
    off_m = np.linalg.norm(frame.camera.world_from_camera[:3, 3] - true[:3, 3])
    assert 0 < off_m < 0.05, "what the robot believes errs, what judges it does not"


def _pose(place: np.ndarray, turn: np.ndarray) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation(turn), place
    return pose
