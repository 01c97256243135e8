"""The node `gslts ros` over DDS: a driver publishes frames, and the map follows the room."""

import array
import contextlib
import json
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import adrift
import numpy as np
import pytest
import update_room
from change_room import VIEWPOINTS, home
from ros_peer import MISSING, Message, Ros, ended, ros_domain

from gslts.core.frame import RgbdFrame
from gslts.core.se3 import pose_distance
from gslts.datasets.poses import pose_from_quat
from gslts.localization.localizer import in_world
from gslts.store.history import open_history
from gslts.store.map_folder import read_map
from gslts_sim.controller import Controller
from gslts_sim.home import Home
from gslts_sim.robot_body import Viewpoint

pytestmark = [pytest.mark.system, pytest.mark.skipif(bool(MISSING), reason=MISSING)]

FRAME = "camera_color_optical_frame"
START_S = 1000
MAX_SENDS = 30
DEACTIVATE, ACTIVE_SHUTDOWN = 4, 7
"""Transitions of lifecycle_msgs."""
AWAY = Viewpoint(x=0.5, y=0.5, yaw_deg=225, horizon_deg=20)
"""Shows a corner of the room, and nothing that changes."""


@dataclass
class Driver:
    """Publishes the frames of a robot with drifting odometry, as a camera driver would."""

    ros: Ros
    ticks: int = 0

    def send(self, frame: RgbdFrame) -> int:
        """Publish a frame and its pose; return the number of its stamp."""
        self.ticks += 1
        adrift_frame = in_world(frame, adrift.ODOMETRY_FROM_WORLD)
        camera, header = frame.camera, self.header(FRAME)
        fx, fy, cx, cy = camera.fx, camera.fy, camera.cx - 0.5, camera.cy - 0.5
        self.ros.publish(
            "/camera/color/camera_info",
            "sensor_msgs/msg/CameraInfo",
            header=header,
            width=camera.width,
            height=camera.height,
            distortion_model="plumb_bob",
            d=[0.0] * 5,
            k=np.array([fx, 0, cx, 0, fy, cy, 0, 0, 1.0]),
        )
        self.pose(adrift_frame.camera.world_from_camera)
        depth = np.rint(1000 * frame.depth).astype("<u2")
        self.image("/camera/aligned_depth_to_color/image_raw", "16UC1", depth)
        self.image("/camera/color/image_raw", "rgb8", frame.rgb)
        return self.ticks

    def header(self, frame_id: str) -> Message:
        return {"stamp": {"sec": START_S + self.ticks, "nanosec": 0}, "frame_id": frame_id}

    def pose(self, pose: np.ndarray) -> None:
        from scipy.spatial.transform import Rotation

        quaternion = Rotation.from_matrix(pose[:3, :3]).as_quat().tolist()
        self.ros.publish(
            "/camera/pose",
            "geometry_msgs/msg/PoseStamped",
            header=self.header("odom"),
            pose={
                "position": dict(zip("xyz", pose[:3, 3].tolist(), strict=True)),
                "orientation": dict(zip("xyzw", quaternion, strict=True)),
            },
        )

    def image(self, topic: str, encoding: str, pixels: np.ndarray) -> None:
        self.ros.publish(
            topic,
            "sensor_msgs/msg/Image",
            header=self.header(FRAME),
            height=pixels.shape[0],
            width=pixels.shape[1],
            encoding=encoding,
            step=pixels.strides[0],
            data=array.array("B", pixels.tobytes()),
        )


def frames_of(room: Home, viewpoints: list[Viewpoint]) -> Iterator[RgbdFrame]:
    robot = Controller(room, width=320, height=240, noise="kinect")
    for viewpoint in viewpoints:
        robot.go(viewpoint)
        yield robot.step("Pass").observation


@pytest.fixture
def ros() -> Iterator[Ros]:
    with ros_domain() as domain:
        yield domain


@contextlib.contextmanager
def running(ros: Ros, folder: Path, *options: str) -> Iterator[subprocess.Popen[str]]:
    """Run a node on a map of the room; it works, and it ends well."""
    adrift.write_room_map(folder / "map")
    for topic in ("/gslts/events", "/gslts/answer"):
        ros.subscribe(topic, "std_msgs/msg/String")
    ros.subscribe("/gslts/pose", "geometry_msgs/msg/PoseWithCovarianceStamped")
    ros.subscribe("/gslts/grid", "nav_msgs/msg/OccupancyGrid", latched=True)
    ros.subscribe("/gslts/changes", "visualization_msgs/msg/MarkerArray", latched=True)
    node = ros.start(
        *("ros", "--map", "map", "--pose", "/camera/pose", "--threads", "1"),
        *("--rate", "100", *options),
        cwd=folder,
    )
    try:
        ros.wait("/gslts/grid")
        yield node
    finally:
        status, _, errors = ended(node, signal.SIGINT)
    assert status == 0, errors


def localized(ros: Ros, driver: Driver, frame: RgbdFrame) -> Message:
    """Send a frame until the node gives its pose: the first messages of a publisher may be lost."""
    sent: set[int] = set()
    for _ in range(MAX_SENDS):
        sent.add(START_S + driver.send(frame))
        for _ in range(20):
            for message in ros.take("/gslts/pose"):
                if message["header"]["stamp"]["sec"] in sent:
                    return message
            time.sleep(0.1)
    raise AssertionError(f"no pose came for {MAX_SENDS} frames")


def test_the_map_follows_the_room(ros: Ros, tmp_path: Path) -> None:
    with running(ros, tmp_path):
        driver = Driver(ros)
        for frame in frames_of(home(), VIEWPOINTS):
            message = localized(ros, driver, frame)
            p, q = (message["pose"]["pose"][name] for name in ("position", "orientation"))
            pose = pose_from_quat((q["w"], q["x"], q["y"], q["z"]), (p["x"], p["y"], p["z"]))
            off_m, off_rad = pose_distance(frame.camera.world_from_camera, pose)
            assert off_m < 0.03
            assert off_rad < 0.03
            assert message["header"]["frame_id"] == "map"
            covariance = message["pose"]["covariance"].reshape(6, 6)
            assert np.linalg.eigvalsh(covariance).min() > 0
        viewpoints = update_room.viewpoints_of_the_change()
        for frame in frames_of(update_room.changed_home("removal"), viewpoints):
            localized(ros, driver, frame)
        driver.ticks += 30  # The robot has left the region.
        for frame in frames_of(home(), [AWAY]):
            driver.send(frame)
        ros.wait("/gslts/events", lambda m: json.loads(m["data"]).get("number") == 2)
    assert update_room.opaque_in(read_map(tmp_path / "map"), update_room.REMOVED, 0.04) == 0
    with open_history(tmp_path / "map") as history:
        assert [event.kind for event in history.events()] == ["removal"]


def test_what_is_wrong_is_named_and_the_node_goes_on(ros: Ros, tmp_path: Path) -> None:
    depth = "/camera/aligned_depth_to_color/image_raw"
    with running(ros, tmp_path):
        driver, (frame,) = Driver(ros), frames_of(home(), VIEWPOINTS[:1])
        ros.subscribe("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")
        for topic in ("/camera/color/image_raw", "/camera/pose"):
            assert message_of(ros, topic, "nobody") == "nobody publishes it"
        localized(ros, driver, frame)
        for topic, encoding, pixels, reason in (
            (depth, "16UC1", np.zeros((6, 8), np.uint16), "8 x 6 px, and its CameraInfo 320 x 240"),
            (depth, "yuv422", np.zeros((240, 320), np.uint16), "encoding yuv422 is not one of"),
        ):
            driver.send(frame)
            driver.ticks += 1
            driver.pose(frame.camera.world_from_camera)
            driver.image(topic, encoding, pixels)
            driver.image("/camera/color/image_raw", "rgb8", frame.rgb)
            assert reason in message_of(ros, "/camera/color/image_raw", reason)
        nowhere = np.eye(4)
        nowhere[0, 3] = np.nan
        driver.pose(nowhere)
        assert "not finite" in message_of(ros, "/camera/pose", "not finite")
        for topic, words, reason in (
            ("query", "sofa", "it has no words; gslts semantics adds them"),
            ("query", " ", "expected the name of an object"),
            ("go", "sofa", "needs --active"),
            ("command", "dance", "expected one of build, explore, extend, round, consolidate"),
        ):
            ros.publish(f"/gslts/{topic}", "std_msgs/msg/String", data=words)
            answer = json.loads(ros.wait("/gslts/answer")["data"])
            assert answer["status"] == "failed"
            assert reason in answer["reason"]
        localized(ros, driver, frame)
    with open_history(tmp_path / "map") as history:
        assert history.version().number == 1


def test_a_request_waits_for_the_first_frame(ros: Ros, tmp_path: Path) -> None:
    ros.subscribe("/goal_pose", "geometry_msgs/msg/PoseStamped")
    (frame,) = frames_of(home(), VIEWPOINTS[:1])
    with running(ros, tmp_path, "--active"):
        ros.subscribe("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")
        ros.publish("/gslts/command", "std_msgs/msg/String", data="round")
        # A frame counts from then on, and this camera gives no second one.
        message_of(ros, "operation", "command: round")
        localized(ros, Driver(ros), frame)
        assert ros.wait("/goal_pose")["header"]["frame_id"] == "odom"


def test_a_lifecycle_shutdown_ends_the_node(ros: Ros, tmp_path: Path) -> None:
    """It is active from the start, and cannot be deactivated."""

    def change_to(transition: int) -> bool:
        kind, fields = "lifecycle_msgs/srv/ChangeState", {"id": transition}
        return bool(ros.call("/gslts/change_state", kind, transition=fields)["success"])

    with running(ros, tmp_path) as node:
        state = ros.call("/gslts/get_state", "lifecycle_msgs/srv/GetState")
        assert state["current_state"]["label"] == "active"
        assert not change_to(DEACTIVATE)
        assert ros.call("/gslts/get_state", "lifecycle_msgs/srv/GetState") == state
        assert change_to(ACTIVE_SHUTDOWN)
        assert node.wait(60) == 0


def message_of(ros: Ros, name: str, part: str) -> str:
    """Return the message of a topic or part of the node in the diagnostics, once it has words."""

    def messages(array: Message) -> list[str]:
        return [s["message"] for s in array["status"] if s["name"] == f"gslts: {name}"]

    found = ros.wait("/diagnostics", lambda m: any(part in text for text in messages(m)))
    return messages(found)[0]


def test_a_robot_without_ros_is_told(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "gslts", "ros", "--map", str(tmp_path / "map")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    expected = (
        "gslts: No module named 'rclpy': source ROS 2 first, such as /opt/ros/jazzy/setup.bash"
    )
    assert done.stderr.strip() == expected


def test_a_missing_map_is_named(ros: Ros, tmp_path: Path) -> None:
    node = ros.start("ros", "--map", "nowhere", "--pose", "/p", cwd=tmp_path)
    _, errors = node.communicate(timeout=60)
    assert node.returncode == 1
    assert errors.splitlines()[-1] == "gslts: nowhere: there is no map; --build makes one"
