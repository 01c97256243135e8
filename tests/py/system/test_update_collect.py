"""Collection of views around a change."""

from collections.abc import Callable
from dataclasses import replace

import change_room
import numpy as np
import pytest
import update_room
from update_room import COLLECT, REMOVED

from gslts.core.camera import Camera, at_pose, look_at
from gslts.core.frame import RgbdFrame
from gslts.core.robot import Robot
from gslts.robots.recorded import RecordedRobot
from gslts.update.config import CollectConfig
from gslts.update.evidence import is_visible, join_parts
from gslts.update.region import Region
from gslts.update.view_collection import collect_views
from gslts_sim.controller import Controller

REGION = Region("before", *REMOVED)


def moved_region(by: np.ndarray) -> Region:
    return Region("before", REGION.low + by, REGION.high + by)


class Recorder:
    """A robot that notes its commands, and cannot reach positions beyond an obstacle."""

    def __init__(self, robot: Controller, blocked: float = np.inf) -> None:
        self.robot, self.blocked = robot, blocked
        self.asked: list[np.ndarray] = []

    def observe(self) -> RgbdFrame:
        return self.robot.observe()

    def pose(self) -> np.ndarray:
        return self.robot.pose()

    def reachable_positions(self) -> np.ndarray:
        positions = self.robot.reachable_positions()
        return positions[positions[:, 0] < self.blocked]

    def move_towards(
        self, position: np.ndarray, yaw_rad: float, pitch_rad: float | None = None
    ) -> bool:
        self.asked.append(
            np.array([*position, yaw_rad, np.nan if pitch_rad is None else pitch_rad])
        )
        return self.robot.move_towards(position, yaw_rad, pitch_rad)


def recorder(blocked: float = np.inf) -> Recorder:
    return Recorder(update_room.robot_in(update_room.changed_home("removal")), blocked)


def collect_around(robot: Robot, config: CollectConfig = COLLECT) -> tuple[int, np.ndarray]:
    """Return the number of views, and their bearings from the change in their order."""
    found = collect_views(robot, change_room.detector(), [update_room.detected("removal")], config)
    eyes = np.array([view.camera.world_from_camera[:2, 3] for view in found.views])
    directions = eyes.reshape(-1, 2) - REGION.center[:2]
    return len(found.views), np.arctan2(directions[:, 1], directions[:, 0])


def test_robot_moves_left_then_right_and_faces_the_region() -> None:
    robot = recorder()
    count, bearings = collect_around(robot)
    assert count == COLLECT.steps + 1
    turns = (bearings - bearings[0] + np.pi) % (2 * np.pi) - np.pi
    left = COLLECT.steps // 2
    assert turns[left] == max(turns) > 0.5
    assert (turns[left + 1 :] < 0).all()
    gaps = np.diff(np.sort([*bearings, bearings.min() + 2 * np.pi]))
    assert gaps.max() < np.pi / 3, "all sides are covered"
    middle = update_room.collected("removal").regions[0].center
    for x, y, yaw_rad, pitch_rad in robot.asked:
        way = middle[:2] - (x, y)
        assert np.cos(yaw_rad - np.arctan2(way[1], way[0])) > np.cos(0.2)
        assert 0.1 < pitch_rad < 1.0
        assert 0.7 <= np.hypot(*way) < 1.6


def test_views_show_the_change_and_its_region() -> None:
    found = update_room.collected("removal")
    (region,) = found.regions
    assert region.side == "before"
    np.testing.assert_allclose(region.low, REMOVED[0], atol=0.06)
    np.testing.assert_allclose(region.high, REMOVED[1], atol=0.06)
    for view in found.views:
        assert view.before.sum() > 50
        assert not view.after.any()
        assert view.before.shape == view.frame.depth.shape
        x0, y0, x1, y1 = region.project_box(view.camera, 4)
        assert view.before[y0:y1, x0:x1].sum() == view.before.sum()


def test_a_blocked_side_gives_more_steps_to_the_other() -> None:
    count, bearings = collect_around(recorder(blocked=2.3))
    free, _ = collect_around(recorder())
    assert 4 <= count <= free
    assert (np.cos(bearings) < 0.4).all()  # Nowhere right of the obstacle.


def test_collection_ends_after_the_configured_steps() -> None:
    count, _ = collect_around(recorder(), CollectConfig(steps=2, distance_m=1.0))
    assert count == 3


def test_a_region_without_a_change_is_left_after_three_views() -> None:
    robot = Recorder(update_room.robot_in(change_room.home()))
    changes = [update_room.detected("removal")]
    found = collect_views(robot, change_room.detector(), changes, COLLECT)
    assert found.rejected == ((changes[0], "only 0 of 3 views show a removed object there"),)
    assert len(robot.asked) == 3


def test_reports_of_one_object_are_joined() -> None:
    whole = update_room.detected("removal")
    assert whole.boxes[0] is not None
    low, high = whole.boxes[0]
    middle = (low + high) / 2
    part = replace(whole, boxes=((middle, high + 0.02), None), before=None)
    apart = np.array([0.6, 0, 0])
    beside = replace(whole, boxes=((low + apart, high + apart), None), before=None)
    changes, parts = join_parts([whole, beside, part])
    assert parts == [part]
    assert changes[1] is beside
    np.testing.assert_allclose(changes[0].boxes[0], (low, high + 0.02))
    robot = recorder()
    found = collect_views(robot, change_room.detector(), [whole, part], COLLECT)
    assert len(found.changes) == 1
    assert found.rejected == ((part, "it is a part of another change"),)


def test_frames_of_one_region_count_for_another() -> None:
    robot, alone = recorder(), recorder()
    change = update_room.detected("removal")
    assert change.boxes[0] is not None
    low, high = change.boxes[0]
    apart = np.array([0.15, 0, 0])
    beside = replace(change, boxes=((low + apart, high + apart), None))
    collect_views(alone, change_room.detector(), [change], COLLECT)
    found = collect_views(robot, change_room.detector(), [change, beside], COLLECT)
    assert len(found.changes) == 2
    assert len(robot.asked) <= len(alone.asked) + COLLECT.steps // 2


def test_without_reachable_positions_there_is_no_view() -> None:
    count, _ = collect_around(recorder(blocked=-1.0))
    assert count == 0


def test_occluded_or_outside_regions_are_not_visible() -> None:
    frame = update_room.robot_in(update_room.changed_home("removal")).observe()
    assert is_visible(frame, REGION)
    near = np.full_like(frame.depth, 0.3)
    assert not is_visible(replace(frame, depth=near), REGION)
    assert is_visible(replace(frame, depth=np.zeros_like(near)), REGION)  # Unknown depth.
    behind = moved_region(-np.array([0, 5, 0]))
    beside = moved_region(np.array([3, 0, 0]))
    assert not is_visible(frame, behind)
    assert not is_visible(frame, beside)


@pytest.mark.parametrize(("column", "expected"), [(2.0, True), (-2.0, False)])
def test_regions_near_the_border_of_an_image_are_visible(column: float, expected: bool) -> None:
    frame = update_room.robot_in(update_room.changed_home("removal")).observe()
    camera, center = frame.camera, REGION.project_center(frame.camera)
    assert center is not None
    shifted = Camera(
        fx=camera.fx,
        fy=camera.fy,
        cx=camera.cx + column - center[0],
        cy=camera.cy,
        width=camera.width,
        height=camera.height,
        world_from_camera=camera.world_from_camera,
    )
    nothing = np.zeros_like(frame.depth)
    assert is_visible(replace(frame, camera=shifted, depth=nothing), REGION) == expected


def test_each_frame_of_a_recording_is_used_once() -> None:
    robot = recorder()
    changes = [update_room.detected("removal")]
    collect_views(robot, change_room.detector(), changes, COLLECT)
    frames = []
    for x, y, yaw_rad, pitch_rad in robot.asked[:5]:
        assert robot.move_towards(np.array([x, y]), yaw_rad, pitch_rad)
        frames.append(robot.observe())
    recorded = RecordedRobot([robot.observe(), *frames])
    found = collect_views(recorded, change_room.detector(), changes, COLLECT)
    assert 3 <= len(found.views) <= 6
    assert len({view.frame.time_s for view in found.views}) == len(found.views)


def of_own_camera(frame: RgbdFrame) -> RgbdFrame:
    """Return a frame whose depth is that of another camera at the same position."""
    return replace(frame, depth_camera=frame.camera)


def cut_off(frame: RgbdFrame) -> RgbdFrame:
    """Return a frame that has depth outside of its mask."""
    mask = np.ones(frame.depth.shape, np.bool_)
    mask[:, :5] = False
    return replace(frame, mask=mask)


@pytest.mark.parametrize("change_frame", [lambda frame: frame, of_own_camera, cut_off])
def test_each_frame_in_which_a_change_was_detected_is_one_view(
    change_frame: Callable[[RgbdFrame], RgbdFrame],
) -> None:
    views = update_room.collected("removal").views[:3]
    frames = [
        change_frame(replace(view.frame, time_s=float(k), labels=None))
        for k, view in enumerate(views)
    ]
    changes = [update_room.detected("removal")]
    found = collect_views(
        RecordedRobot(frames), change_room.detector(), changes, COLLECT, recorded=frames
    )
    assert [view.frame.time_s for view in found.views] == [0.0, 1.0, 2.0]
    for view in found.views:
        assert view.frame.depth_camera is None
        assert view.frame.mask is None or not view.frame.depth[~view.frame.mask].any()


@pytest.mark.parametrize("pixels", [0, 7])
def test_a_region_outside_of_the_image_has_no_rectangle(pixels: int) -> None:
    camera = update_room.robot_in(change_room.home()).observe().camera
    beside = moved_region(np.array([9, 0, 0]))
    behind = moved_region(-np.array([0, 5, 0]))
    assert beside.project_box(camera, pixels) is None
    assert behind.project_box(camera, pixels) is None
    x0, y0, x1, y1 = REGION.project_box(camera, pixels)
    assert 0 <= x0 < x1 <= camera.width
    assert 0 <= y0 < y1 <= camera.height


def test_views_that_cannot_judge_a_change_do_not_confirm_it() -> None:
    gaussian_map, cameras = change_room.mapped()
    nowhere = look_at(np.array([-5.0, -5.0, 1.0]), np.array([-6.0, -5.0, 1.0]))
    away = at_pose(next(iter(cameras.values())), nowhere)
    found = collect_views(
        update_room.robot_in(update_room.changed_home("removal")),
        change_room.detector().with_map(gaussian_map, [away]),
        [update_room.detected("removal")],
        COLLECT,
    )
    assert found.changes == ()
    ((_, reason),) = found.rejected
    assert reason == (
        "0 view(s) can judge it, 2 are needed: too few training cameras saw this position"
    )
