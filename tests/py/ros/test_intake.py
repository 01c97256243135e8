"""Serialized messages of a camera become frames: the newest complete ones."""

import json
from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest
from ros_bags import START_NS, Recorder

from gslts.core.camera import Camera, camera_from_fov
from gslts.core.se3 import pose_distance
from gslts.ros.config import Topics
from gslts.ros.intake import Intake
from gslts.ros.live_poses import LivePoses, NoPoses, TopicPoses
from gslts.ros.problems import Problems

RGB, DEPTH = "/camera/color/image_raw", "/camera/aligned_depth_to_color/image_raw"
INFO, POSE, LABELS = "/camera/color/camera_info", "/camera/pose", "/labels"
FRAME = "camera_color_optical_frame"
CAMERA = camera_from_fov(16, 12, 1.0, np.eye(4))
MS = 1_000_000
TOPICS = Topics(rgb=RGB, depth=DEPTH)


class Driver:
    """Sends messages of a camera to an intake, as ROS would serialize them."""

    def __init__(self, topics: Topics = TOPICS, poses: LivePoses | None = None) -> None:
        self.recorder, self.said, self.types = Recorder(), [], {}
        self.poses = TopicPoses(None) if poses is None else poses
        problems = Problems(self.said.append)
        self.intake = Intake(topics, self.poses, self.decode, problems)

    def decode(self, topic: str, message: bytes) -> Any:
        try:
            return self.recorder.store.deserialize_cdr(message, self.types[topic])
        except Exception as error:
            raise ValueError(str(error)) from None

    def send(self) -> None:
        for _, topic, message in self.recorder.messages:
            self.types[topic] = message.__msgtype__
            if topic == POSE:
                self.poses.add(message)
                continue
            raw = bytes(self.recorder.store.serialize_cdr(message, message.__msgtype__))
            add = self.intake.add_info if topic == INFO else self.intake.add_image
            add(topic, raw)
        self.recorder.messages.clear()

    def info(self, camera: Camera = CAMERA, **changed: Any) -> None:
        header = self.recorder.header(START_NS, FRAME)
        self.recorder.info(INFO, camera, **{"header": header, **changed})
        self.send()

    def image(self, ms: int, value: int = 100, topic: str = RGB) -> None:
        shape = (CAMERA.height, CAMERA.width)
        pixels, encoding = np.full(shape, value, np.uint16), "16UC1"
        if topic == RGB:
            pixels, encoding = np.full((*shape, 3), value, np.uint8), "rgb8"
        self.recorder.image(topic, START_NS + ms * MS, FRAME, encoding, pixels)
        self.send()

    def frame(self, ms: int, value: int = 100) -> None:
        self.image(ms, 2000, DEPTH)
        self.image(ms, value)

    def pose_at(self, ms: int, x_m: float = 0.0) -> None:
        pose = np.eye(4)
        pose[0, 3] = x_m
        self.recorder.pose("geometry_msgs/msg/PoseStamped", POSE, START_NS + ms * MS, "odom", pose)
        self.send()

    def pose_all(self, times_ms: Iterable[int]) -> None:
        for ms in times_ms:
            self.pose_at(ms, ms / 1000)


@pytest.fixture
def driver() -> Driver:
    ready = Driver()
    ready.info()
    ready.pose_all(range(0, 1001, 50))
    return ready


def test_a_frame_has_its_images_its_camera_and_the_pose_of_its_time(driver: Driver) -> None:
    driver.frame(425, 77)
    frame = driver.intake.take(0)
    assert frame is not None
    assert (frame.rgb == 77).all()
    assert (frame.depth == np.float32(2.0)).all()
    np.testing.assert_allclose(frame.camera.world_from_camera[:3, 3], (0.425, 0, 0), atol=1e-9)
    assert frame.camera.fx == pytest.approx(CAMERA.fx)
    assert frame.camera.cx == pytest.approx(CAMERA.cx)
    assert frame.time_s == pytest.approx((START_NS + 425 * MS) * 1e-9, abs=1e-6)
    assert driver.said == []


def test_the_newest_frame_is_taken_once_and_older_ones_are_dropped(driver: Driver) -> None:
    for number in range(4):
        driver.frame(100 + 33 * number, number)
    frame = driver.intake.take(0)
    assert frame is not None
    assert frame.rgb[0, 0, 0] == 3
    assert driver.intake.take(0) is None
    counts = driver.intake.counts
    assert (counts.received, counts.taken, counts.dropped) == (4, 1, 3)


def test_a_frame_without_a_pose_yet_waits_for_it(driver: Driver) -> None:
    driver.frame(980, 1)
    driver.frame(1013, 2)
    first = driver.intake.take(0)
    assert first is not None
    assert first.rgb[0, 0, 0] == 1, "the newest one with a pose"
    driver.pose_at(1050, 1.05)
    second = driver.intake.take(0)
    assert second is not None
    assert second.rgb[0, 0, 0] == 2


def test_a_gap_of_the_poses_is_not_bridged(driver: Driver) -> None:
    driver.pose_at(11_000, 9.0)
    for number in range(6):
        driver.frame(5000 + 33 * number)
    assert driver.intake.take(0) is None
    assert driver.said == [f"{RGB}: there are no two poses around it at most 0.3 s apart"]


def test_an_image_without_depth_is_no_frame(driver: Driver) -> None:
    driver.image(100, 2000, DEPTH)
    for number in range(5):
        driver.image(140 + number * 33)
    assert driver.intake.take(0) is None
    assert driver.said == [f"{RGB}: there is no image of {DEPTH} within 0.02 s of it"]


def test_missing_intrinsics_are_named() -> None:
    driver = Driver()
    driver.pose_all((0, 100))
    driver.frame(50)
    assert driver.intake.take(0) is None
    assert driver.said == [f"{INFO}: no CameraInfo has come yet"]


def test_empty_intrinsics_are_named(driver: Driver) -> None:
    driver.info(k=np.zeros(9))
    driver.frame(100)
    assert driver.intake.take(0) is None
    expected = f"{RGB}: {INFO}: a focal length of 0 px does not fit an image of 16 x 12 px"
    assert driver.said == [expected]


def test_intrinsics_that_change_hold_for_later_frames(driver: Driver) -> None:
    driver.frame(100)
    before = driver.intake.take(0)
    driver.info(camera_from_fov(16, 12, 0.5, np.eye(4)))
    driver.frame(133)
    after = driver.intake.take(0)
    assert before is not None
    assert after is not None
    assert after.camera.fx > 2 * before.camera.fx


def test_depth_of_another_size_is_named(driver: Driver) -> None:
    pixels = np.full((6, 8), 2000, np.uint16)
    driver.recorder.image(DEPTH, START_NS + 100 * MS, FRAME, "16UC1", pixels)
    driver.image(100)
    assert driver.intake.take(0) is None
    expected = (
        f"{RGB}: {DEPTH} has 8 x 6 px, and its CameraInfo 16 x 12 px; depth that is not registered "
        "needs --depth-info"
    )
    assert driver.said == [expected]


def test_a_damaged_message_is_named_and_the_next_one_is_used(driver: Driver) -> None:
    driver.image(100, 2000, DEPTH)
    driver.intake.add_image(RGB, b"short")
    assert driver.said == [f"{RGB}: a message of 5 bytes has no header"]
    header = bytes(
        driver.recorder.store.serialize_cdr(
            driver.recorder.header(START_NS + 100 * MS, FRAME), "std_msgs/msg/Header"
        )
    )
    driver.types[RGB] = "sensor_msgs/msg/Image"
    driver.intake.add_image(RGB, header)
    assert driver.intake.take(0) is None
    driver.frame(133)
    assert driver.intake.take(0) is not None


def test_late_and_unstamped_images_are_dropped(driver: Driver) -> None:
    driver.frame(200)
    driver.image(150)
    driver.recorder.image(RGB, 0, FRAME, "rgb8", np.zeros((12, 16, 3), np.uint8))
    driver.send()
    assert [line.removeprefix(f"{RGB}: ") for line in driver.said] == [
        "an image is older than the last one: dropped",
    ], "the second problem of a topic waits a second"
    assert driver.intake.take(0) is not None
    assert driver.intake.counts.received == 1


def test_frames_go_on_after_the_clock_was_set_back(driver: Driver) -> None:
    driver.frame(900)
    assert driver.intake.take(0) is not None
    driver.pose_at(-60_000, 5.0)
    driver.pose_at(-59_900, 5.0)
    driver.frame(-59_950, 9)
    frame = driver.intake.take(0)
    assert frame is not None
    assert frame.camera.world_from_camera[0, 3] == 5.0
    assert driver.said == [f"{DEPTH}: the clock was set back: waiting images are dropped"]


def test_without_a_source_of_poses_all_frames_have_the_same() -> None:
    driver = Driver(poses=NoPoses())
    driver.info()
    driver.frame(100)
    frame = driver.intake.take(0)
    assert frame is not None
    np.testing.assert_array_equal(frame.camera.world_from_camera, np.eye(4))
    with pytest.raises(ValueError, match="there is no source of poses"):
        driver.intake.latest_pose()


def test_labels_come_with_a_frame() -> None:
    driver = Driver(TOPICS.model_copy(update={"labels": LABELS, "label_names": "/names"}))
    driver.info()
    driver.pose_all((0, 100))
    driver.intake.add_label_names(json.dumps(["Mug", "Sofa"]))
    driver.image(50, 2, LABELS)
    driver.frame(50)
    frame = driver.intake.take(0)
    assert frame is not None
    assert frame.labels is not None
    assert frame.labels.types[frame.labels.instances[0, 0]] == "Sofa"


@pytest.mark.parametrize("text", ["", "{}", "[1]", "[" * 100_000, "[" * 2_000_000])
def test_damaged_label_names_are_named(text: str) -> None:
    driver = Driver(TOPICS.model_copy(update={"labels": LABELS, "label_names": "/names"}))
    driver.intake.add_label_names(text)
    assert len(driver.said) == 1
    assert driver.said[0].startswith("/names: ")


@pytest.mark.parametrize(
    "pose",
    [np.full((4, 4), np.nan), np.diag([np.inf, 1, 1, 1])],
)
def test_a_pose_that_is_not_finite_is_rejected(driver: Driver, pose: np.ndarray) -> None:
    message = driver.recorder.make(
        "geometry_msgs/msg/PoseStamped",
        header=driver.recorder.header(START_NS, "odom"),
        pose=driver.recorder.make(
            "geometry_msgs/msg/Pose",
            position=driver.recorder.make("geometry_msgs/msg/Point", x=pose[0, 0], y=0.0, z=0.0),
            orientation=driver.recorder.make(
                "geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0
            ),
        ),
    )
    with pytest.raises(ValueError, match="not finite"):
        driver.poses.add(message)


def test_the_mount_places_the_camera_on_its_base() -> None:
    driver = Driver(poses=TopicPoses((0.1, 0.0, 0.9, -np.pi / 2, 0.0, -np.pi / 2)))
    driver.info()
    driver.pose_all((0, 100))
    pose = driver.intake.latest_pose()
    expected = np.array([[0, 0, 1, 0.2], [-1, 0, 0, 0], [0, -1, 0, 0.9], [0, 0, 0, 1]])
    assert pose_distance(expected, pose) == pytest.approx((0, 0), abs=1e-6)


def test_poses_of_another_frame_need_a_mount(driver: Driver) -> None:
    recorder = driver.recorder
    recorder.pose("nav_msgs/msg/Odometry", POSE, START_NS, "odom", np.eye(4), "base_link")
    driver.send()
    with pytest.raises(ValueError, match=f"of base_link and the images of {FRAME}: give --mount"):
        driver.intake.latest_pose()
