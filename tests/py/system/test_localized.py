"""Localized frames and robots, and changes detected from them."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import adrift
import change_room
import numpy as np
import pytest
import sim_scenes
import update_room
from adrift import ODOMETRY_FROM_WORLD, Adrift
from change_room import SIZE, VIEWPOINTS, see
from update_room import LOOP
from watching import LONG_S

from gslts.change.confirmation import MonitorConfig
from gslts.change.detection import Detection
from gslts.change.detector import ChangeDetector
from gslts.change.monitor import ChangeMonitor
from gslts.core.camera import at_pose, look_at
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.core.robot import Robot
from gslts.core.se3 import pose_distance, rotation
from gslts.keeper import keeper as keeper_module
from gslts.keeper.keeper import MapKeeper
from gslts.localization.constants import TRACKING_M
from gslts.localization.localizer import Localizer, in_world
from gslts.localization.relocalizer import Localization, Relocalizer
from gslts.robots.driving import go_to
from gslts.robots.localized import LocalizedRobot, localized
from gslts.robots.recorded import RecordedRobot
from gslts.store.map_folder import read_map
from gslts_sim.controller import Controller

WELL_M, WELL_RAD = 0.03, np.deg2rad(1)
"""Maximum error of a pose of such small images, m and rad."""


def afar(frame: RgbdFrame) -> RgbdFrame:
    """Return a frame as a robot with drifting odometry delivers it."""
    return in_world(frame, ODOMETRY_FROM_WORLD)


def black(frame: RgbdFrame) -> RgbdFrame:
    return replace(frame, rgb=np.zeros_like(frame.rgb))


def elsewhere() -> RgbdFrame:
    """Return a frame of a room that is not in the map."""
    return Controller(sim_scenes.simple_home(), **SIZE).observe()


def assert_there(found: RgbdFrame, true: RgbdFrame) -> None:
    metres, turn_rad = pose_distance(true.camera.world_from_camera, found.camera.world_from_camera)
    assert metres < WELL_M
    assert turn_rad < WELL_RAD


def detected(frame: RgbdFrame) -> Detection:
    return change_room.detector().detect(frame)


class Scripted:
    """A relocalizer with scripted results that records its calls."""

    def __init__(self, tracked: Localization, localized: Localization) -> None:
        self.tracked, self.localized, self.asked = tracked, localized, []

    def track(self, _: RgbdFrame, world_from_camera: np.ndarray) -> Localization:
        self.asked.append(world_from_camera)
        return self.tracked

    def localize(self, _: RgbdFrame) -> Localization:
        self.asked.append(None)
        return self.localized


LOST = Localization("lost", "no luck")


def ok(pose: np.ndarray) -> Localization:
    return Localization("ok", "", pose, 1e-6 * np.eye(6))


def shifted(x: float) -> np.ndarray:
    pose = np.eye(4)
    pose[0, 3] = x
    return pose


def at(x: float) -> RgbdFrame:
    """Return a frame at x in the odometry."""
    frame = elsewhere()
    return replace(frame, camera=at_pose(frame.camera, shifted(x)))


@pytest.mark.parametrize("viewpoint", VIEWPOINTS)
def test_a_frame_is_localized_whatever_its_odometry(viewpoint: object) -> None:
    true = see(change_room.home(), viewpoint, "kinect")
    localizer = adrift.localizer()
    found = localizer.localize_frame(afar(true))
    assert found.fault is None
    assert_there(found, true)
    assert found.depth is true.depth
    np.testing.assert_allclose(
        localizer.world_from_odometry @ ODOMETRY_FROM_WORLD, np.eye(4), atol=0.05
    )


def test_chains_of_rounded_poses_stay_rigid() -> None:
    """A camera may be off by a millionth; products of cameras would be off by more."""
    frame = change_room.see(change_room.home(), change_room.VIEWPOINTS[0])
    sheared = np.eye(4)
    sheared[0, 1] = 9e-7
    for _ in range(4):
        frame = in_world(frame, sheared)
    turned = frame.camera.world_from_camera[:3, :3]
    np.testing.assert_allclose(turned @ turned.T, np.eye(3), rtol=0, atol=1e-12)


def test_a_separate_depth_camera_moves_along() -> None:
    frame = see(change_room.home(), VIEWPOINTS[0])
    beside = at_pose(frame.camera, frame.camera.world_from_camera @ shifted(0.03))
    found = adrift.localizer().localize_frame(afar(replace(frame, depth_camera=beside)))
    color, depth = found.camera.world_from_camera, found.depth_camera.world_from_camera
    np.testing.assert_allclose(np.linalg.inv(color) @ depth, shifted(0.03), atol=1e-9)


@pytest.mark.smoke
def test_a_localized_robot_is_tracked_by_its_odometry() -> None:
    """Tracking needs the odometry between distant views."""
    localizer = adrift.localizer()
    first = localizer.localize(afar(see(change_room.home(), VIEWPOINTS[0])))
    assert first.inliers > 0
    true = see(change_room.home(), VIEWPOINTS[1])
    tracked = localizer.localize(afar(true))
    assert (tracked.status, tracked.inliers) == ("ok", 0)
    metres, _ = pose_distance(tracked.world_from_camera, true.camera.world_from_camera)
    assert metres < WELL_M


def test_a_kidnapped_robot_is_relocalized() -> None:
    localizer = adrift.localizer()
    here, there = (see(change_room.home(), viewpoint) for viewpoint in VIEWPOINTS[:2])
    localizer.localize(afar(here))
    # The odometry has not noticed.
    carried = replace(there, camera=afar(here).camera)
    found = localizer.localize(carried)
    assert (found.status, found.inliers > 0) == ("ok", True)
    metres, turn_rad = pose_distance(found.world_from_camera, there.camera.world_from_camera)
    assert metres < WELL_M
    assert turn_rad < WELL_RAD


def test_tracking_starts_at_the_predicted_pose() -> None:
    relocalizer = Scripted(ok(shifted(5.02)), ok(shifted(4.0)))
    localizer = Localizer(relocalizer)
    assert localizer.world_from_odometry is None
    localizer.localize(at(1.0))
    np.testing.assert_allclose(localizer.world_from_odometry, shifted(3.0))
    found = localizer.localize_frame(at(2.0))
    first, second = relocalizer.asked
    assert first is None
    np.testing.assert_allclose(second, shifted(5.0))
    np.testing.assert_allclose(found.camera.world_from_camera, shifted(5.02))
    np.testing.assert_allclose(localizer.world_from_odometry, shifted(3.02))


@pytest.mark.parametrize(
    "tracked",
    [
        LOST,
        ok(shifted(5.0 + 1.1 * TRACKING_M)),
    ],
)
def test_failed_tracking_is_followed_by_relocalization(tracked: Localization) -> None:
    relocalizer = Scripted(tracked, ok(shifted(4.0)))
    localizer = Localizer(relocalizer)
    localizer.localize(at(1.0))
    assert localizer.localize(at(2.0)) is relocalizer.localized
    assert [prior is None for prior in relocalizer.asked] == [True, False, True]
    np.testing.assert_allclose(localizer.world_from_odometry, shifted(2.0))


@pytest.mark.parametrize(
    "unsure",
    [LOST, replace(ok(shifted(9.0)), status="ambiguous", reason="no luck")],
)
def test_an_uncertain_frame_keeps_the_predicted_pose_and_has_a_fault(
    unsure: Localization,
) -> None:
    relocalizer = Scripted(LOST, unsure)
    localizer = Localizer(relocalizer)
    unknown = localizer.localize_frame(at(1.0))
    np.testing.assert_array_equal(unknown.camera.world_from_camera, shifted(1.0))
    relocalizer.localized = ok(shifted(4.0))
    assert localizer.localize_frame(at(1.0)).fault is None
    relocalizer.localized = unsure
    expected = localizer.localize_frame(at(2.0))
    np.testing.assert_allclose(expected.camera.world_from_camera, shifted(5.0))
    np.testing.assert_allclose(localizer.world_from_odometry, shifted(3.0))
    for frame in (unknown, expected):
        assert frame.fault == f"{unsure.status}: no luck"
        assert frame.depth.any(), "it may show unmapped space"
        assert frame.registered().fault == frame.halved().fault == frame.fault


@pytest.mark.parametrize(
    "spoilt", [lambda: black(see(change_room.home(), VIEWPOINTS[0])), elsewhere]
)
def test_a_lost_frame_has_no_changes(spoilt: Callable[[], RgbdFrame]) -> None:
    found = adrift.localizer().localize_frame(spoilt())
    assert found.fault.startswith("lost: ")
    detection = detected(found)
    assert detection.unreliable == found.fault
    assert detection.changes == ()


@pytest.mark.parametrize("kind", ["removal", "addition", "relocation"])
def test_changes_are_detected_as_with_true_poses(kind: update_room.Kind) -> None:
    localizer = adrift.localizer()
    for viewpoint in VIEWPOINTS:
        true = see(update_room.changed_home(kind), viewpoint)
        assert detected(afar(true)).unreliable is not None
        expected, found = detected(true), detected(localizer.localize_frame(afar(true)))
        assert found.unreliable is None
        assert [change.kind for change in found.changes] == [
            change.kind for change in expected.changes
        ]
        for change, other in zip(found.changes, expected.changes, strict=True):
            np.testing.assert_allclose(change.point, other.point, atol=0.05)


def test_a_black_image_without_depth_is_not_tracked() -> None:
    localizer = adrift.localizer()
    frame = afar(see(change_room.home(), VIEWPOINTS[0]))
    assert localizer.localize(frame).status == "ok"
    nothing = replace(black(frame), depth=np.zeros_like(frame.depth))
    assert localizer.localize(nothing).status == "lost"


def test_the_monitor_localizes_frames() -> None:
    changed = [
        see(update_room.changed_home("removal"), viewpoint)
        for viewpoint in (*VIEWPOINTS, *VIEWPOINTS)
    ]
    config = MonitorConfig(rate_hz=1e6, queue=9)
    localize_frame = adrift.localizer().localize_frame
    with ChangeMonitor(change_room.detector(), config, localize=localize_frame) as monitor:
        for frame in (afar(changed[0]), black(changed[0]), elsewhere(), *map(afar, changed[1:])):
            monitor.offer(frame)
        assert monitor.wait(LONG_S)
        (report,) = monitor.poll()
    assert report.change.kind == "removal"
    assert (monitor.counts.processed, monitor.counts.unreliable) == (8, 2)


@pytest.mark.parametrize("far", [(0, 0, 0), (412_345.25, 5_432_109.5, 300)])
def test_a_robot_moves_to_positions_of_the_map(far: tuple[float, float, float]) -> None:
    robot = update_room.robot_in(change_room.home())
    localized: Robot = LocalizedRobot(Adrift(robot, far), adrift.localizer())
    np.testing.assert_allclose(
        localized.reachable_positions(), robot.reachable_positions(), atol=0.1
    )
    wanted = at_pose(
        robot.observe().camera, look_at(np.array([1.5, 0.5, 1.5]), np.array([2.5, 1.5, 0.8]))
    )
    assert go_to(localized, wanted)
    true = robot.observe()
    np.testing.assert_allclose(true.camera.world_from_camera[:3, 3], (1.5, 0.5, 1.5), atol=1e-6)
    ahead = wanted.world_from_camera[:3, 2] @ true.camera.world_from_camera[:3, 2]
    assert ahead > np.cos(2 * WELL_RAD)
    assert_there(localized.observe(), true)
    metres, turn_rad = pose_distance(localized.pose(), true.camera.world_from_camera)
    assert metres < WELL_M
    assert turn_rad < WELL_RAD


def test_a_recorded_frame_is_localized_once() -> None:
    frames = [see(change_room.home(), viewpoint) for viewpoint in VIEWPOINTS[:2]]
    relocalizer = Scripted(LOST, ok(frames[0].camera.world_from_camera))
    robot = LocalizedRobot(RecordedRobot(frames), Localizer(relocalizer))
    first = robot.observe()
    assert robot.observe() is first
    assert len(relocalizer.asked) == 1
    assert go_to(robot, frames[1].camera)
    relocalizer.tracked = ok(frames[1].camera.world_from_camera)
    assert robot.observe() is not first
    assert go_to(robot, frames[0].camera)
    assert robot.observe() is first
    assert len(relocalizer.asked) == 2


def test_without_any_localization_the_odometry_is_used() -> None:
    robot = Controller(sim_scenes.simple_home(), **SIZE)
    localized = LocalizedRobot(robot, adrift.localizer())
    np.testing.assert_array_equal(localized.pose(), robot.pose())
    np.testing.assert_array_equal(localized.reachable_positions(), robot.reachable_positions())
    assert localized.move_towards(np.array([1.0, 1.0]), 0.5)
    frame = localized.observe()
    assert frame.fault.startswith("lost: ")
    pose = robot.observe().camera.world_from_camera
    np.testing.assert_array_equal(frame.camera.world_from_camera, pose)
    np.testing.assert_allclose(np.arctan2(pose[1, 2], pose[0, 2]), 0.5)


def test_a_robot_with_drift_keeps_a_map_up_to_date(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = adrift.write_room_map(tmp_path / "map")
    robot = Adrift(update_room.robot_in(update_room.changed_home("removal")))
    with MapKeeper(folder, LOOP) as keeper:
        keeper.go_round(robot)
        assert keeper.version.number == 1, "nothing is certain so far off"
    made = []

    def noted(gaussian_map: GaussianMap, *rest: object) -> Relocalizer:
        made.append(gaussian_map.size)
        return Relocalizer(gaussian_map, *rest)

    monkeypatch.setattr(keeper_module, "Relocalizer", noted)
    with MapKeeper(folder, replace(LOOP, relocalization=adrift.CONFIG)) as keeper:
        keeper.go_round(localized(robot, keeper.localizer))
        assert keeper.version.number > 1
        versions = keeper.version.number
    updated = read_map(folder)
    assert len(made) == versions, "one a version"
    assert (made[0], made[-1]) == (change_room.mapped()[0].size, updated.size)
    assert update_room.opaque_in(updated, update_room.REMOVED, 0.04) == 0
    detector = ChangeDetector(updated, change_room.CONFIG)
    home = update_room.changed_home("removal")
    views = [see(home, viewpoint, "kinect", seed) for viewpoint in VIEWPOINTS for seed in range(4)]
    for view in views:
        assert detected(view).changes, "the map before shows the box"
    assert sum(detector.detect(view).changes == () for view in views) >= 10


def test_a_robot_in_another_home_changes_nothing(tmp_path: Path) -> None:
    folder = adrift.write_room_map(tmp_path / "map")
    with MapKeeper(folder, replace(LOOP, max_viewpoints=3, relocalization=adrift.CONFIG)) as keeper:
        keeper.go_round(localized(Controller(sim_scenes.simple_home(), **SIZE), keeper.localizer))
        assert keeper.version.number == 1
        assert keeper.state.deferred == ()


def test_missing_landmarks_are_named_before_a_round(tmp_path: Path) -> None:
    change_room.write_room_map(tmp_path / "map")
    with pytest.raises(ValueError, match="map: it has no landmarks; gslts map makes maps that do"):
        MapKeeper(tmp_path / "map", replace(LOOP, relocalization=adrift.CONFIG))


def test_the_distance_of_poses_is_in_metres_and_radians() -> None:
    turned = shifted(0.2)
    turned[:3, :3] = rotation(np.array([0, 0.3, 0]))
    assert pose_distance(np.eye(4), turned) == pytest.approx((0.2, 0.3))
    assert pose_distance(turned, turned) == pytest.approx((0, 0), abs=1e-6)
