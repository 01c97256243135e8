"""Tests of the simulated robot as a ROS 2 node: a peer in another process meets it over DDS."""

import math
import signal
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import ros_peer
from command import gslts
from ros_peer import Message, Ros
from scipy.spatial.transform import Rotation

from gslts.core.camera import Camera
from gslts_sim import make_home
from gslts_sim.change_sampler import TaskSettings
from gslts_sim.day import make_day
from gslts_sim.home_source import HomeSource
from gslts_sim.raycast import RayCaster
from gslts_sim.walkable import floor_of

pytestmark = pytest.mark.skipif(bool(ros_peer.MISSING), reason=ros_peer.MISSING)

SIZE = ("--width", "64", "--height", "48")
COLOUR, DEPTH = "/camera/color/image_raw", "/camera/aligned_depth_to_color/image_raw"
INFO, POSE, TRUE = "/camera/color/camera_info", "/camera/pose", "/robot/true_pose"
POSE_TYPE, TRIGGER = "geometry_msgs/msg/PoseStamped", "std_srvs/srv/Trigger"


STARTED = "robot in bedroom 2: {} changes to come; Ctrl-C ends it\n"


@pytest.fixture(scope="module")
def domain() -> Iterator[Ros]:
    with ros_peer.ros_domain() as ros:
        yield ros


@pytest.fixture(scope="module")
def ros(domain: Ros, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Ros]:
    """Run a robot for all tests of this file; its end is a test as well."""
    options = ("--noise", "none", "--rate", "20", "--changes", "2", *SIZE)
    folder = tmp_path_factory.mktemp("robot")
    process = domain.start("sim", "ros", "bedroom", "2", *options, cwd=folder)
    for topic in (COLOUR, DEPTH):
        domain.subscribe(topic, "sensor_msgs/msg/Image", best_effort=True)
    domain.subscribe(INFO, "sensor_msgs/msg/CameraInfo", best_effort=True)
    for topic in (POSE, TRUE):
        domain.subscribe(topic, POSE_TYPE)
    domain.subscribe("/odom", "nav_msgs/msg/Odometry")
    assert ros_peer.first_line(process) == STARTED.format(2)
    yield domain
    status, _, errors = ros_peer.ended(process, signal.SIGTERM)
    assert status == 0, errors
    assert "Traceback" not in errors
    assert "terminate" not in errors


def stamp(message: Message) -> int:
    time = message["header"]["stamp"]
    return int(time["sec"]) * 10**9 + int(time["nanosec"])


def matrix(pose: Message) -> np.ndarray:
    """Return a Pose as [4,4]."""
    result = np.eye(4)
    result[:3, :3] = Rotation.from_quat([pose["orientation"][k] for k in "xyzw"]).as_matrix()
    result[:3, 3] = [pose["position"][k] for k in "xyz"]
    return result


def go(ros: Ros, x: float, y: float, yaw_rad: float, frame: str = "odom") -> None:
    turn = {"z": math.sin(yaw_rad / 2), "w": math.cos(yaw_rad / 2)}
    pose = {"position": {"x": x, "y": y}, "orientation": turn}
    ros.take("/odom")
    ros.publish("/goal_pose", POSE_TYPE, header={"frame_id": frame}, pose=pose)


def is_moving(odometry: Message) -> bool:
    twist = odometry["twist"]["twist"]
    return twist["linear"]["x"] != 0 or twist["angular"]["z"] != 0


@pytest.mark.smoke
def test_image_depth_and_pose_are_of_one_moment(ros: Ros) -> None:
    """Frames taken in motion show what a camera at the true pose of their stamp sees."""
    ros.publish("/tilt_controller/commands", "std_msgs/msg/Float64MultiArray", data=[0.4])
    go(ros, 0.5, 0.3, 2.0)
    ros.wait("/odom", is_moving)
    for topic in (COLOUR, DEPTH, INFO, POSE, TRUE):
        ros.take(topic)
    ros.wait("/odom", lambda odometry: not is_moving(odometry))
    by_topic = {
        topic: {stamp(message): message for message in ros.take(topic)}
        for topic in (COLOUR, DEPTH, INFO, POSE, TRUE)
    }
    common = sorted(set.intersection(*map(set, by_topic.values())))
    assert len(common) >= 3
    home = make_home("bedroom", 2)
    caster = RayCaster(home)
    for time_ns in common[:: len(common) // 3]:
        colour, depth, info, _, true = (messages[time_ns] for messages in by_topic.values())
        assert colour["header"]["frame_id"] == info["header"]["frame_id"]
        fx, _, cx, _, fy, cy = info["k"][:6]
        pose = matrix(true["pose"])
        camera = Camera(
            fx=fx, fy=fy, cx=cx + 0.5, cy=cy + 0.5, width=64, height=48, world_from_camera=pose
        )
        expected = caster.render(camera).depth
        measured = np.asarray(depth["data"], np.uint8).view("<u2").reshape(48, 64) / 1000
        assert np.quantile(np.abs(measured - expected), 0.98) < 0.001
        assert colour["encoding"] == "rgb8"
        assert np.asarray(colour["data"]).std() > 10
    motion = [matrix(by_topic[TRUE][time_ns]["pose"]) for time_ns in common]
    assert np.linalg.norm(motion[-1][:3, 3] - motion[0][:3, 3]) > 0.05


def test_the_robot_drives_to_a_goal_by_its_odometry(ros: Ros) -> None:
    go(ros, 0.0, 0.0, -1.0)
    ros.wait("/odom", is_moving)
    last = ros.wait("/odom", lambda odometry: not is_moving(odometry))
    assert (last["header"]["frame_id"], last["child_frame_id"]) == ("odom", "base_link")
    pose = matrix(last["pose"]["pose"])
    assert np.linalg.norm(pose[:2, 3]) < 0.05
    assert math.atan2(pose[1, 0], pose[0, 0]) == pytest.approx(-1, abs=0.001)
    true = matrix(ros.next(TRUE)["pose"])
    assert floor_of(make_home("bedroom", 2)).is_free(true[:2, 3])


def test_odometry_is_stamped_by_the_ticks_of_the_robot(ros: Ros) -> None:
    ros.take("/odom")
    messages: list[Message] = []
    while len(messages) < 10:
        messages += ros.take("/odom")
    # 25 Hz; on a busy machine some may get lost, or the robot pauses.
    steps = np.diff([stamp(message) for message in messages])
    assert (steps > 0).all()
    assert (steps % 40_000_000 == 0).all()


def test_goals_that_make_no_sense_are_ignored(ros: Ros) -> None:
    before = ros.next(TRUE)["pose"]
    go(ros, 1.0, 0.0, 0.0, frame="map")
    go(ros, math.nan, 0.0, 0.0)
    go(ros, 1e300, 0.0, 0.0)
    ros.publish("/goal_pose", POSE_TYPE, header={"frame_id": "odom"},
                pose={"orientation": {"w": 0.0}})  # fmt: skip
    ros.publish("/tilt_controller/commands", "std_msgs/msg/Float64MultiArray", data=[])
    ros.publish("/tilt_controller/commands", "std_msgs/msg/Float64MultiArray", data=[math.inf])
    assert [ros.next(TRUE)["pose"] for _ in range(5)] == [before] * 5


def test_changes_happen_on_request(ros: Ros) -> None:
    said = [ros.call("/robot/change", TRIGGER) for _ in range(3)]
    assert [answer["success"] for answer in said] == [True, True, False]
    assert said[0]["message"].split(" of ")[0] in ("addition", "removal", "relocation")
    assert said[2]["message"] == "no change is left"


def test_odometry_does_not_notice_that_the_robot_is_carried_away(ros: Ros) -> None:
    before, true = ros.next(POSE), matrix(ros.next(TRUE)["pose"])
    assert ros.call("/robot/carry_away", TRIGGER)["success"]

    def is_elsewhere(message: Message) -> bool:
        return bool(np.linalg.norm(matrix(message["pose"])[:3, 3] - true[:3, 3]) > 0.9)

    moved = ros.wait(TRUE, is_elsewhere)
    after = ros.wait(POSE, lambda message: stamp(message) >= stamp(moved))
    assert after["pose"] == before["pose"]


def test_poses_stop_and_the_clock_is_set_back(ros: Ros) -> None:
    before = stamp(ros.next(TRUE))
    assert ros.call("/robot/set_clock_back", TRIGGER)["success"]
    ros.wait(TRUE, lambda message: stamp(message) < before - 30 * 10**9)
    assert ros.call("/robot/lose_poses", TRIGGER)["success"]
    ros.next(TRUE)
    ros.take(POSE)
    for _ in range(5):
        ros.next(TRUE)
    assert ros.take(POSE) == []
    assert stamp(ros.wait(POSE)) < before


def test_ctrl_c_ends_it_cleanly(domain: Ros, tmp_path: Path) -> None:
    process = domain.start("sim", "ros", "bedroom", "2", "--changes", "0", *SIZE, cwd=tmp_path)
    assert ros_peer.first_line(process) == STARTED.format(0)
    status, _, errors = ros_peer.ended(process, signal.SIGINT)
    assert status == 0, errors
    assert "Traceback" not in errors


def test_bad_arguments_are_named(domain: Ros, tmp_path: Path) -> None:
    day = make_day(*HomeSource.of_seed("bedroom", 20), TaskSettings(width=64, height=48), 20, 1)
    (tmp_path / "day.json").write_text(day.model_dump_json())
    for arguments, expected in {
        ("attic",): "expected one of kitchen, living_room",
        ("kitchen", "3", "--day", "day.json"): "day.json is a day of bedroom 20, not of kitchen 3",
    }.items():
        process = domain.start("sim", "ros", *arguments, cwd=tmp_path)
        _, errors = process.communicate(timeout=ros_peer.LONG_S)
        assert process.returncode == 1, errors
        [line] = errors.splitlines()
        assert expected in line


def test_without_ros_it_names_what_is_missing(tmp_path: Path) -> None:
    done = gslts("sim", "ros", "kitchen", "3", cwd=tmp_path)
    assert done.returncode == 1
    [line] = done.stderr.splitlines()
    assert "No module named 'rclpy': source ROS 2 first" in line
