"""Rounds of a robot that keeps a map up to date."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import change_room
import numpy as np
import pytest
import update_room
from update_room import LOOP as CONFIG
from update_room import Changing

from gslts.change.changes import Change
from gslts.change.confirmation import Report
from gslts.change.visibility import Visibility
from gslts.core.camera import Camera, at_pose, look_at
from gslts.core.robot import Robot, RobotLostError
from gslts.keeper import coverage as rounds
from gslts.keeper.coverage import plan_viewpoints
from gslts.keeper.keeper import MapKeeper, StoppedError
from gslts.keeper.schedule import MAX_DELAY_ROUNDS, DeferredChange, defer, select_changes
from gslts.keeper.state import STATE, KeeperState, read_state, write_state
from gslts.robots.driving import go_to
from gslts.store.map_folder import open_map, read_map
from gslts_sim.controller import Controller


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    change_room.write_room_map(tmp_path / "map")
    return tmp_path / "map"


def keeper_of(folder: Path, **callbacks: Callable[..., object]) -> MapKeeper:
    return MapKeeper(folder, CONFIG, **callbacks)  # type: ignore[arg-type]


def robot_of(kind: update_room.Kind) -> Controller:
    return update_room.robot_in(update_room.changed_home(kind))


def change_at(x: float, y: float, confidence: float) -> Change:
    """Return the removal of an object at a position on the floor."""
    found = update_room.detected("removal")
    box = found.boxes[0]
    assert box is not None
    offset = np.array([x - 2.2, y - 1.85, 0])
    low, high = box[0] + offset, box[1] + offset
    return replace(found, confidence=confidence, point=(low + high) / 2, boxes=((low, high), None))


def test_planned_viewpoints_cover_the_map() -> None:
    gaussian_map, cameras = change_room.mapped()
    stops = plan_viewpoints(gaussian_map, cameras, 100)
    points = gaussian_map.means[::7]
    seen = Visibility(gaussian_map, cameras.values()).visible(points, rounds.MAX_DEPTH_M)
    covered = Visibility(gaussian_map, [cameras[name] for name in stops]).visible(
        points, rounds.MAX_DEPTH_M
    )
    assert covered.any(axis=0).sum() > 0.9 * seen.any(axis=0).sum()
    assert len(set(stops)) == len(stops) < len(cameras) / 2, "few viewpoints suffice"
    assert len(plan_viewpoints(gaussian_map, cameras, 3)) == 3


def test_planning_without_cameras_is_rejected() -> None:
    gaussian_map, _ = change_room.mapped()
    with pytest.raises(ValueError, match="the map has no training cameras"):
        plan_viewpoints(gaussian_map, {}, 3)


def test_robot_moves_to_the_pose_of_a_camera() -> None:
    robot = robot_of("removal")
    eye, target = np.array([1.5, 0.5, 1.5]), np.array([2.5, 1.5, 0.8])
    wanted = at_pose(robot.observe().camera, look_at(eye, target))
    assert go_to(robot, wanted)
    there = robot.observe().camera.world_from_camera
    assert np.allclose(there[:3, 3], eye, atol=1e-6)
    assert np.allclose(there[:3, 2], wanted.world_from_camera[:3, 2], atol=1e-6)


def test_a_round_integrates_a_change_and_the_next_one_finds_none(tmp_path: Path) -> None:
    """With strong noise, errors of the map itself may be found in a later round."""
    home, settled = update_room.changed_home("removal"), 0
    for seed in range(4):
        folder = tmp_path / str(seed)
        change_room.write_room_map(folder)
        said: list[str] = []
        with keeper_of(folder, log=said.append) as keeper:
            keeper.go_round(Controller(home, **change_room.SIZE, noise="kinect", seed=seed))
            first = keeper.version.number
            assert first > 1
            assert update_room.opaque_in(read_map(folder), update_room.REMOVED, 0.04) == 0
            assert keeper.state == read_state(folder)
            assert keeper.state.round == keeper.state.source_rounds == 1
            keeper.go_round(Controller(home, **change_room.SIZE, noise="kinect", seed=seed + 10))
            settled += keeper.version.number == first
        assert any(words.startswith("removal at (2.") for words in said)
        assert any(words.startswith("version 2: ") for words in said)
        with open_map(folder) as store:
            assert store.version(2).cause.round == 0
    assert settled >= 3


@pytest.mark.smoke
def test_a_stopped_and_continued_round_gives_the_same_map(folder: Path, tmp_path: Path) -> None:
    change_room.write_room_map(tmp_path / "other")
    with keeper_of(tmp_path / "other") as keeper:
        keeper.go_round(robot_of("addition"))
    stops = 0
    for calls in (1, 9, 30, 10_000):  # Number of polls before the stop.
        left = iter(range(calls))
        with keeper_of(folder, should_stop=lambda left=left: next(left, None) is None) as keeper:
            try:
                keeper.go_round(robot_of("addition"))
            except StoppedError:
                stops += 1
                assert keeper.state.round == 0
                assert keeper.state == read_state(folder)
    assert stops == 3
    assert read_state(folder).round == 1
    continued, other = read_map(folder), read_map(tmp_path / "other")
    for name in ("means", "quats", "log_scales", "logit_opacities", "sh", "ids"):
        assert np.array_equal(getattr(continued, name), getattr(other, name)), name


def test_a_change_that_cannot_be_integrated_is_deferred_and_retried(folder: Path) -> None:
    frames = CONFIG.max_frames

    def restless() -> Robot:  # The box is back as soon as the robot comes near.
        return Changing(update_room.changed_home("removal"), change_room.home(), frames)

    said: list[str] = []
    start = {"start": at_the_block()}
    with keeper_of(folder, log=said.append) as keeper:
        keeper.go_round(restless(), start)
        assert keeper.version.number == 1
        (deferred,) = keeper.state.deferred
        assert (deferred.kind, deferred.attempts, deferred.retry_round) == ("removal", 1, 1)
        assert deferred.reason in said[-1]
        keeper.go_round(restless(), start)
        (deferred,) = keeper.state.deferred
        assert (deferred.attempts, deferred.retry_round) == (2, 3)
        tried = len(said)
        keeper.go_round(restless(), start)
        assert len(said) == tried, "the change is deferred"
        assert keeper.state.deferred == (deferred,)
        keeper.go_round(robot_of("removal"), start)
        assert keeper.state.deferred == ()
        assert keeper.version.number == 2
    with open_map(folder) as store:
        assert len(store.rejections()) == 2


def test_a_deferred_change_that_is_not_detected_again_is_forgotten(folder: Path) -> None:
    deferred = DeferredChange(
        kind="removal", point=(2.2, 1.8, 0.9), reason="no view", attempts=1, retry_round=0
    )
    write_state(KeeperState(deferred=(deferred,)), folder)
    with keeper_of(folder) as keeper:
        keeper.go_round(update_room.robot_in(change_room.home()), {"start": at_the_block()})
        assert keeper.state.deferred == ()


def test_what_lasts_is_reported_again_after_a_round(folder: Path) -> None:
    with keeper_of(folder) as keeper:
        assert [report.change.kind for report in watched(keeper)] == ["removal"]
        assert watched(keeper) == [], "it was reported"
        keeper.end_round()  # As by a node that watches a robot on its own errands.
        assert [report.change.kind for report in watched(keeper)] == ["removal"]


def test_what_a_lost_robot_left_is_reported_again(folder: Path) -> None:
    class Lost(Controller):
        def move_towards(self, *_: object) -> bool:
            raise RobotLostError

    robot = Lost(update_room.changed_home("removal"), **change_room.SIZE)
    robot.go(change_room.VIEWPOINTS[0])
    with keeper_of(folder) as keeper:
        reports = watched(keeper)
        with pytest.raises(RobotLostError):
            keeper.integrate(robot, reports)
        (again,) = keeper.reports()
        assert again.change is reports[0].change
        assert keeper.reports() == []
        keeper.integrate(robot_of("removal"), reports)
        assert keeper.version.number == 2
        assert keeper.reports() == []


def test_the_most_confident_and_nearest_change_is_selected_with_its_neighbors() -> None:
    near, far, sure = change_at(1, 1, 0.5), change_at(4, 3, 0.5), change_at(4, 3.5, 1.0)
    position = np.array([0.5, 0.5])
    assert select_changes([far, near], position) == [near]
    assert select_changes([near, far, sure], position) == [near]
    assert select_changes([far, sure], position) == [far, sure]
    assert select_changes([change_at(1, 1, 0.1), sure], position) == [sure]


def test_the_delay_doubles_with_each_attempt() -> None:
    deferred: tuple[DeferredChange, ...] = ()
    number = 0
    for wait in (1, 2, 4, 8, 16, 16):
        deferred = defer(deferred, change_at(1, 1, 0.5), "why", number)
        assert [change.retry_round for change in deferred] == [number + wait]
        number += wait
    assert wait == MAX_DELAY_ROUNDS
    assert len(defer(deferred, change_at(3, 3, 0.5), "why", 0)) == 2


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("{", "Invalid JSON"),
        ('{"round": -1}', "round: Input should be greater than or equal to 0"),
        ('{"rund": 1}', "rund: Extra inputs are not permitted"),
        ('{"schema_version": 2}', "schema_version: Input should be 1"),
    ],
)
def test_a_damaged_state_is_named(folder: Path, content: str, message: str) -> None:
    (folder / STATE).write_text(content)
    with pytest.raises(ValueError, match=f"{STATE}: .*{message}.*; remove the file to start"):
        keeper_of(folder)
    with open_map(folder, writable=True) as store:  # The lock was released.
        assert store.version().number == 1


def at_the_block() -> Camera:
    return update_room.robot_in(change_room.home()).observe().camera


def watched(keeper: MapKeeper) -> list[Report]:
    """Let the keeper see that the box is gone, and return what it reports."""
    for _ in range(CONFIG.monitor.window):
        keeper.watch(robot_of("removal").observe())
    return keeper.reports()
