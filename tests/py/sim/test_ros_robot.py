"""Tests of the robot that the ROS 2 node publishes, without ROS: motion, odometry and changes."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import sim_scenes

from gslts.core.camera import camera_from_fov
from gslts.core.se3 import product
from gslts_sim.actions import DisableObject, PlaceObjectAtPoint, Point, SceneState
from gslts_sim.changes import ChangeError
from gslts_sim.day import ChangeEvent
from gslts_sim.robot_body import FOV_RAD, Viewpoint, robot_camera
from gslts_sim.ros.drive import SPEED_M_S, TURN_RAD_S, Drive
from gslts_sim.ros.odometry import DISTANCE_STD, SCALE_STD, YAW_STD_RAD, Odometry
from gslts_sim.ros.planar_pose import PlanarPose, wrap_angle
from gslts_sim.ros.robot import ARRIVED_M, ARRIVED_RAD, TICK_S, SimulatedRobot, base_from_camera
from gslts_sim.ros.scripted_home import ScriptedHome
from gslts_sim.sensor import Sensor
from gslts_sim.task import Change

SIZE = (64, 48)


def robot_in(*events: ChangeEvent, drift: float = 0.0) -> tuple[SimulatedRobot, ScriptedHome]:
    """Return a robot in `furnished_home`, with a block of 1.2 x 0.8 m in its middle."""
    sensor = Sensor("none")
    home = ScriptedHome(SceneState(sim_scenes.furnished_home()), events, sensor)
    return SimulatedRobot(home, sensor, SIZE, seed=1, drift=drift), home


def goal_at(robot: SimulatedRobot, x: float, y: float, yaw_rad: float = 0.0) -> PlanarPose:
    """Return a goal in the frame of the odometry for a pose in the world."""
    return PlanarPose(x, y, yaw_rad).carried(robot.state.true, robot.state.believed)


def run_until_still(robot: SimulatedRobot) -> list[PlanarPose]:
    """Let ticks pass until the robot stands; return the true poses."""
    poses = [robot.state.true]
    while True:
        state = robot.advance()
        poses.append(state.true)
        if poses[-1] == poses[-2]:
            return poses
        assert len(poses) < 3000


def box_change(object_id: str, x: float, y: float) -> ChangeEvent:
    """Return the relocation of an object; its boxes are of no interest here."""
    box = ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    return ChangeEvent(
        actions=(PlaceObjectAtPoint(objectId=object_id, position=Point(x=x, y=y, z=0.0)),),
        change=Change(
            kind="relocation", object_id=object_id, object_type="Mug", box_before=box, box_after=box
        ),
    )


def removal(object_id: str) -> ChangeEvent:
    box = ((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    return ChangeEvent(
        actions=(DisableObject(objectId=object_id),),
        change=Change(
            kind="removal", object_id=object_id, object_type="Mug", box_before=box, box_after=None
        ),
    )


def test_the_robot_drives_around_obstacles_to_its_goal() -> None:
    robot, home = robot_in()
    assert robot.go_to(goal_at(robot, 0.5, 2.0)) == ""
    run_until_still(robot)
    assert robot.go_to(goal_at(robot, 4.5, 1.9, math.pi / 2)) == ""  # Behind the block.
    poses = run_until_still(robot)
    assert poses[-1].position == pytest.approx((4.5, 1.9), abs=0.002)
    assert wrap_angle(poses[-1].yaw_rad - math.pi / 2) == pytest.approx(0, abs=ARRIVED_RAD)
    assert all(home.scene.floor.is_free(pose.position) for pose in poses)
    steps = np.array([(b.x - a.x, b.y - a.y, b.yaw_rad - a.yaw_rad) for a, b in pairwise(poses)])
    assert np.hypot(*steps[:, :2].T).max() <= SPEED_M_S * TICK_S + 1e-9
    assert np.abs(steps[:, 2]).max() <= TURN_RAD_S * TICK_S + 1e-9


def test_without_a_path_the_robot_drives_to_the_nearest_free_position() -> None:
    robot, home = robot_in()
    robot.go_to(goal_at(robot, 2.6, 1.0))
    run_until_still(robot)
    robot.go_to(goal_at(robot, 2.6, 1.6))  # In the block, whose edge is at y = 1.5.
    last = run_until_still(robot)[-1]
    assert last.position == pytest.approx((2.6, 1.3), abs=0.06)
    assert home.scene.floor.is_free(last.position)
    robot.go_to(goal_at(robot, -50.0, 1.0))  # Outside of the room.
    assert run_until_still(robot)[-1].position == pytest.approx((0.2, 1.0), abs=0.06)


def test_a_new_goal_replaces_the_old_one() -> None:
    robot, _ = robot_in()
    robot.go_to(goal_at(robot, 4.5, 3.5))
    for _ in range(20):
        robot.advance()
    robot.go_to(goal_at(robot, 0.5, 0.5))
    assert run_until_still(robot)[-1].position == pytest.approx((0.5, 0.5), abs=0.002)


def test_perfect_odometry_is_the_motion_from_the_start() -> None:
    robot, _ = robot_in()
    start = robot.state.true
    robot.go_to(goal_at(robot, 4.5, 3.0, 2.0))
    run_until_still(robot)
    expected = robot.state.true.carried(start, PlanarPose(0.0, 0.0, 0.0))
    assert robot.state.believed == pytest.approx(expected, abs=1e-9)


def test_odometry_drifts_as_much_as_it_claims() -> None:
    """Errors after 16 m straight ahead, of many robots, have the documented spread."""
    metres, step_m = 16.0, 0.25
    ends = []
    for seed in range(400):
        odometry = Odometry(seed)
        for _ in range(round(metres / step_m)):
            odometry.add(0.0, step_m)
        ends.append(odometry.pose)
    x, _, yaw_rad = np.array(ends).T
    # 400 samples: the standard deviation is within 15 % (4 of its own standard deviations).
    assert yaw_rad.std() == pytest.approx(YAW_STD_RAD * math.sqrt(metres), rel=0.15)
    expected_m = math.hypot(SCALE_STD * metres, DISTANCE_STD * math.sqrt(metres))
    assert x.std() == pytest.approx(expected_m, rel=0.15)
    turned = Odometry(3)
    for _ in range(100):
        turned.add(0.1, 0.0)
    assert turned.pose.position == pytest.approx((0, 0))
    assert 0 < abs(turned.pose.yaw_rad - 10) < 4 * SCALE_STD * 10


def test_the_same_seed_gives_the_same_drift() -> None:
    runs = []
    for _ in range(2):
        robot, _ = robot_in(drift=1.0)
        robot.go_to(goal_at(robot, 4.5, 3.0, 2.0))
        runs.append((run_until_still(robot), robot.state.believed))
    assert runs[0] == runs[1]
    true_end, believed = runs[0][0][-1], runs[0][1]
    expected = true_end.carried(runs[0][0][0], PlanarPose(0.0, 0.0, 0.0))
    assert 0.001 < np.linalg.norm(believed.position - expected.position) < 0.2
    goal = PlanarPose(4.5, 3.0, 2.0).carried(runs[0][0][0], PlanarPose(0.0, 0.0, 0.0))
    assert np.linalg.norm(believed.position - goal.position) < ARRIVED_M  # It arrives by odometry.
    assert wrap_angle(believed.yaw_rad - goal.yaw_rad) == pytest.approx(0, abs=ARRIVED_RAD)


def test_odometry_does_not_notice_that_the_robot_is_carried_away() -> None:
    robot, home = robot_in(drift=1.0)
    robot.go_to(goal_at(robot, 4.5, 3.0))
    for _ in range(20):
        robot.advance()
    before = robot.state
    robot.carry_away()
    after = robot.advance()
    assert after.believed == before.believed
    assert (after.speed_m_s, after.turn_rad_s) == (0, 0)
    assert np.linalg.norm(after.true.position - before.true.position) >= 1
    assert home.scene.floor.can_stand(after.true.position)
    assert robot.advance().true == after.true  # The goal is forgotten.


def test_frames_show_the_home_from_the_true_pose() -> None:
    robot, home = robot_in(drift=5.0)
    robot.go_to(goal_at(robot, 0.8, 3.2, -1.0))
    robot.tilt(0.3)
    run_until_still(robot)
    frame, true = robot.observe(robot.state), robot.state.true
    viewpoint = Viewpoint.at(true.position, math.degrees(true.yaw_rad), math.degrees(0.3))
    expected = home.scene.caster.render(robot_camera(home.scene.state.home, viewpoint, SIZE))
    np.testing.assert_allclose(frame.depth, expected.depth, atol=1e-4)
    believed = product(robot.state.believed.matrix(), base_from_camera(0.3))
    assert not np.allclose(believed, frame.camera.world_from_camera, atol=0.1)


def test_the_camera_tilts_smoothly_within_its_range() -> None:
    robot, _ = robot_in()
    robot.tilt(9.0)
    angles = [robot.advance().tilt_rad for _ in range(60)]
    assert angles[-1] == pytest.approx(math.radians(60))
    assert np.diff([0.0, *angles]).max() < 0.05
    straight = camera_from_fov(*SIZE, FOV_RAD, base_from_camera(0.0)).world_from_camera
    np.testing.assert_allclose(straight[:3, 2], (1, 0, 0), atol=1e-12)  # Ahead.
    np.testing.assert_allclose(straight[:3, 1], (0, 0, -1), atol=1e-12)  # Down.


def test_changes_come_in_order_and_are_seen() -> None:
    robot, home = robot_in(removal("Mug|1"), removal("Mug|2"))
    robot.go_to(goal_at(robot, 2.5, 0.7, math.pi / 2))
    robot.tilt(0.6)
    run_until_still(robot)
    seen = []
    for name in ("Mug|1", "Mug|2"):
        seen.append(shown(robot))
        assert robot.change() == f"removal of {name}"
        assert name not in home.scene.state.home
    assert [*seen, shown(robot)] == [{"Mug|1", "Mug|2"}, {"Mug|2"}, set()]
    with pytest.raises(ChangeError, match="no change is left"):
        robot.change()


def shown(robot: SimulatedRobot) -> set[str]:
    """Return the mugs that a frame shows, by its labels."""
    labels = robot.observe(robot.state).labels
    assert labels is not None
    ids = [obj.id for obj in sim_scenes.furnished_home().objects]
    assert labels.types == tuple(name.split("|")[0] for name in ids)
    rows = np.unique(labels.instances[labels.instances >= 0])
    return {ids[row] for row in rows if labels.types[row] == "Mug"}


def test_a_change_waits_while_the_robot_is_in_the_way() -> None:
    robot, home = robot_in(box_change("Mug|1", 1.0, 1.0), removal("Mug|2"))
    robot.go_to(goal_at(robot, 1.0, 1.0))
    run_until_still(robot)
    with pytest.raises(ChangeError):
        robot.change()
    assert home.changes_left == 2
    robot.go_to(goal_at(robot, 4.0, 3.0))
    run_until_still(robot)
    assert robot.change() == "relocation of Mug|1"


def test_the_robot_plans_again_when_a_change_blocks_its_path() -> None:
    robot, home = robot_in(box_change("Mug|1", 1.6, 0.5))
    robot.go_to(goal_at(robot, 0.5, 0.5))
    run_until_still(robot)
    robot.go_to(goal_at(robot, 4.5, 0.5))
    robot.advance()
    robot.change()
    poses = run_until_still(robot)
    assert poses[-1].position == pytest.approx((4.5, 0.5), abs=0.002)
    assert all(home.scene.floor.is_free(pose.position) for pose in poses)


def test_a_drive_passes_its_corners_exactly() -> None:
    drive = Drive(PlanarPose(0.0, 0.0, 0.0))
    drive.corners = [np.array([1.0, 0.0]), np.array([1.0, 1.0])]
    time_s = 0.0
    while drive.corners:
        drive.advance(0.1)
        time_s += 0.1
        on_path = abs(drive.pose.y) < 1e-6 or abs(drive.pose.x - 1) < 1e-6
        assert on_path, drive.pose
    assert time_s == pytest.approx(2 / SPEED_M_S + (math.pi / 2) / TURN_RAD_S, abs=0.2)


def test_a_home_without_floor_for_the_robot_is_named() -> None:
    home = sim_scenes.furnished_home()
    full = sim_scenes.box_object("Wardrobe|1", (0, 0, 0), (5, 4, 2), sim_scenes.plain(9))
    sensor = Sensor("none")
    crowded = SceneState(replace(home, objects=(*home.objects, full)))
    with pytest.raises(ValueError, match="simple: the robot can stand nowhere"):
        SimulatedRobot(ScriptedHome(crowded, [], sensor), sensor, SIZE, 0, 0.0)
