"""Bags of ROS 2: poses through chains of frames, images of each encoding, and lenses."""

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recorded_frames import frames_of_robot
from reprojection import assert_frames_agree
from robot_bags import (
    BASE_FROM_OPTICAL,
    DEPTH,
    FRAME,
    RGB,
    RGB_INFO,
    add_images,
    add_mount,
    add_tf,
    encoded,
    robot_bag,
    simple_bag,
    time_of,
)
from ros_bags import OPTICAL, START_NS, Recorder, moving

from gslts.core.camera import Camera
from gslts.datasets import open_dataset
from gslts.datasets.undistort import Lens

pytest.importorskip("rosbags")


@pytest.mark.parametrize("storage", ["sqlite3", "mcap"])
def test_a_robots_bag(tmp_path: Path, storage: str) -> None:
    frames = frames_of_robot()
    path = robot_bag(frames).write(tmp_path / "walk", storage)
    for where in (path, next(path.glob("walk.*"))):  # The folder, and the file alone.
        dataset = open_dataset(where)
        assert dataset.name == "walk"
        assert dataset.skipped == ()
        assert len(dataset.frames) == 3
        # Frames can be read in any order.
        for frame, expected in reversed(list(zip(dataset.frames, frames, strict=True))):
            read = frame.read()
            np.testing.assert_array_equal(read.rgb, expected.rgb)
            np.testing.assert_allclose(read.depth, expected.depth, atol=0.00051)
            assert read.mask is None
            np.testing.assert_allclose(
                read.camera.world_from_camera, expected.camera.world_from_camera, atol=1e-6
            )
            for name in ("fx", "fy", "cx", "cy", "width", "height"):
                assert getattr(read.camera, name) == pytest.approx(getattr(expected.camera, name))
    assert [frame.name for frame in dataset.frames][1] == "1700000001.123456789"
    assert_frames_agree([frame.read() for frame in dataset.frames])
    assert read.time_s == pytest.approx(START_NS * 1e-9)


@pytest.mark.parametrize(
    ("kind", "child"),
    [
        ("geometry_msgs/msg/PoseStamped", ""),
        ("geometry_msgs/msg/PoseWithCovarianceStamped", ""),
        ("nav_msgs/msg/Odometry", "base_link"),
        ("nav_msgs/msg/Odometry", "/cam_link"),
        ("nav_msgs/msg/Odometry", FRAME),
    ],
)
def test_poses_of_a_topic(tmp_path: Path, kind: str, child: str) -> None:
    frames = frames_of_robot()
    bag = Recorder()
    add_images(bag, frames)
    add_mount(bag)
    of_child = {"/cam_link": OPTICAL, FRAME: np.eye(4)}.get(child, BASE_FROM_OPTICAL)
    for number, frame in enumerate(frames):
        pose = frame.camera.world_from_camera @ np.linalg.inv(of_child)
        for offset in (-0.06, 0.02):
            time = time_of(number) + round(1e9 * offset)
            bag.pose(kind, "/pose", time, "map", moving(pose, offset), child)
    dataset = open_dataset(bag.write(tmp_path / "walk", "mcap"))
    for frame, expected in zip(dataset.frames, frames, strict=True):
        np.testing.assert_allclose(
            frame.camera.world_from_camera, expected.camera.world_from_camera, atol=1e-6
        )


def test_a_camera_on_a_turning_head_goes_with_the_topic_of_poses(tmp_path: Path) -> None:
    """/tf tells how the head turns but ends at the robot: it is no world."""
    frames = frames_of_robot()
    bag = Recorder()
    add_images(bag, frames)
    bag.tf("/tf_static", START_NS, bag.transform(0, "head", FRAME, OPTICAL))
    for number, frame in enumerate(frames):
        head = np.eye(4)
        head[:3, 3] = (0.0, 0.1 * number, 1.0)
        pose = frame.camera.world_from_camera @ np.linalg.inv(head @ OPTICAL)
        bag.tf("/tf", time_of(number), bag.transform(time_of(number), "base_link", "head", head))
        bag.pose("nav_msgs/msg/Odometry", "/odom", time_of(number), "odom", pose, "base_link")
    dataset = open_dataset(bag.write(tmp_path / "walk", "mcap"))
    for frame, expected in zip(dataset.frames, frames, strict=True):
        np.testing.assert_allclose(
            frame.camera.world_from_camera, expected.camera.world_from_camera, atol=1e-6
        )


def test_frames_without_pose_or_depth_near_in_time_are_named(tmp_path: Path) -> None:
    frames = frames_of_robot()
    bag = robot_bag(frames)
    extra = [(4, 0), (5, 25_000_000)]
    for number, late in extra:
        bag.image(RGB, time_of(number), FRAME, "rgb8", frames[0].rgb)
        steps = np.rint(1000 * frames[0].depth).astype("<u2")
        bag.image(DEPTH, time_of(number) + late, FRAME, "16UC1", steps)
    for offset in (-60_000_000, 60_000_000):  # Too far apart.
        moment = time_of(4) + offset
        bag.tf("/tf", moment, bag.transform(moment, "odom", "base_link", np.eye(4)))
    for name, pose in (("map", "odom"), ("odom", "base_link")):
        moment = time_of(5)
        bag.tf("/tf", moment, bag.transform(moment, name, pose, np.eye(4)))
    bag.tf("/tf", time_of(4), bag.transform(time_of(4), "map", "odom", np.eye(4)))
    dataset = open_dataset(bag.write(tmp_path / "walk", "mcap"))
    assert len(dataset.frames) == 3
    assert dataset.skipped == (
        "1700000004.123456789: odom to base_link: there are no two poses around it at most 0.1 s "
        "apart",
        "1700000005.123456789: there is no depth within 0.02 s",
    )


def test_poses_that_are_none_are_named(tmp_path: Path) -> None:
    bag = robot_bag(frames_of_robot())
    first = next(message for _, topic, message in bag.messages if topic == "/tf")
    first.transforms[0].transform.rotation.w = float("nan")
    dataset = open_dataset(bag.write(tmp_path / "walk", "mcap"))
    assert len(dataset.frames) == 2
    (reason,) = dataset.skipped
    assert reason.endswith(": odom to base_link: the quaternion has length nan, expected 1")


@pytest.mark.parametrize("encoding", ["rgb8", "bgr8", "rgba8", "bgra8", "mono8", "jpeg", "png"])
def test_encodings_of_colours(tmp_path: Path, encoding: str) -> None:
    rgb = np.zeros((48, 64, 3), np.uint8)
    rgb[:20], rgb[20:, :30], rgb[20:, 30:] = (200, 30, 90), (10, 220, 40), (60, 70, 250)
    alpha = np.full((48, 64, 1), 7, np.uint8)

    def add(bag: Recorder, time: int) -> None:
        if encoding in ("jpeg", "png"):
            data = encoded(rgb, encoding.upper())
            kind = f"rgb8; {encoding} compressed bgr8"
            bag.compressed(f"{RGB}/compressed", time, FRAME, kind, data)
            return
        order = [2, 1, 0] if encoding.startswith("bgr") else [0, 1, 2]
        pixels = rgb[..., order]
        if encoding == "mono8":
            pixels = rgb[..., 0]
        elif "a" in encoding:
            pixels = np.concatenate([pixels, alpha], axis=2)
        bag.image(RGB, time, FRAME, encoding, pixels, pad=3)

    read = simple_bag(tmp_path, add).frames[1].read()
    assert (read.depth == 0).all()
    if encoding == "mono8":
        rgb = np.repeat(rgb[..., :1], 3, axis=2)
    if encoding == "jpeg":
        far = np.ones((48, 64), bool)  # From the edges of the colours.
        far[16:24], far[:, 22:38] = False, False
        assert np.abs(read.rgb.astype(int) - rgb)[far].max() <= 8
    else:
        np.testing.assert_array_equal(read.rgb, rgb)


@pytest.mark.parametrize(
    "encoding",
    ["16UC1", "16UC1 big-endian", "32FC1", "compressedDepth", "compressedDepth 32FC1", "png"],
)
def test_encodings_of_depth(tmp_path: Path, encoding: str) -> None:
    depth = np.linspace(0.4, 6.0, 48 * 64, dtype=np.float32).reshape(48, 64)
    depth[5:9, 7:20] = 0
    steps = np.rint(1000 * depth).astype("<u2")

    def add(bag: Recorder, time: int) -> None:
        bag.image(RGB, time, FRAME, "rgb8", np.zeros((48, 64, 3), np.uint8))
        if encoding.startswith("16UC1"):
            order = ">u2" if "big" in encoding else "<u2"
            bag.image(DEPTH, time, FRAME, "16UC1", steps.astype(order), pad=4)
        elif encoding == "32FC1":
            pixels = np.where(depth > 0, depth, np.nan).astype("<f4")
            bag.image(DEPTH, time, FRAME, "32FC1", pixels)
        elif encoding == "png":
            topic = f"{DEPTH}/compressed"
            bag.compressed(topic, time, FRAME, "16UC1; png compressed", encoded(steps, "PNG"))
        else:
            kind, header, pixels = "16UC1; compressedDepth png", struct.pack("<iff", 0, 0, 0), steps
            if encoding.endswith("32FC1"):
                # As compressed_depth_image_transport: the inverse depth in even steps.
                kind, a, b = "32FC1; compressedDepth png", 1000.0, 1 - 1000.0 / 10
                header = struct.pack("<iff", 0, a, b)
                with np.errstate(divide="ignore"):
                    pixels = np.where(depth > 0, np.rint(a / depth + b), 0).astype("<u2")
            data = header + encoded(pixels, "PNG")
            bag.compressed(f"{DEPTH}/compressedDepth", time, FRAME, kind, data)

    read = simple_bag(tmp_path, add).frames[0].read()
    np.testing.assert_array_equal(read.depth == 0, depth == 0)
    tolerance = 0.02 if encoding.endswith(" 32FC1") else 0.00051
    np.testing.assert_allclose(read.depth, depth, atol=tolerance)


def test_depth_of_a_camera_beside_has_its_own_view(tmp_path: Path) -> None:
    frames = frames_of_robot()
    colour = frames[0].camera
    beside = Camera(
        fx=70.0, fy=71.0, cx=41.0, cy=29.5, width=80, height=60, world_from_camera=np.eye(4)
    )
    colour_from_depth = np.eye(4)
    colour_from_depth[:3, 3] = (0.06, 0.005, -0.01)
    bag = Recorder()
    bag.info(RGB_INFO, colour)
    bag.info("/cam/depth/camera_info", beside)
    depth = np.full((60, 80), 2.0, np.float32)
    depth[20:40, 30:50] = 1.0
    add_tf(bag, frames)
    bag.tf("/tf_static", START_NS, bag.transform(0, FRAME, "cam_depth", colour_from_depth))
    for number, frame in enumerate(frames):
        bag.image(RGB, time_of(number), FRAME, "rgb8", frame.rgb)
        steps = (1000 * depth).astype("<u2")
        topic = "/cam/depth/image_rect_raw"
        bag.image(topic, time_of(number), "cam_depth", "16UC1", steps)
    dataset = open_dataset(bag.write(tmp_path / "walk", "mcap"))
    read = dataset.frames[2].read()
    np.testing.assert_array_equal(read.depth, depth)
    assert read.depth_camera is not None
    for name in ("fx", "fy", "cx", "cy", "width", "height"):
        assert getattr(read.depth_camera, name) == pytest.approx(getattr(beside, name))
    np.testing.assert_allclose(
        read.depth_camera.world_from_camera,
        frames[2].camera.world_from_camera @ colour_from_depth,
        atol=1e-6,
    )
    assert read.registered().depth.shape == (48, 64)


def test_lenses(tmp_path: Path) -> None:
    camera = frames_of_robot()[0].camera
    rgb = np.full((48, 64, 3), 100, np.uint8)
    cases = [
        ("plumb_bob", (-0.1, 0.02, 0.001, 0.002, 0.003), RGB, Lens),
        ("rational_polynomial", (0.1, 0.02, 0.001, 0.002, 0.003, 0.1, 0.2, 0.3), RGB, Lens),
        ("equidistant", (-0.1, 0.02, 0.001, 0.002), RGB, Lens),
        ("plumb_bob", (0, 0, 0, 0, 0), RGB, None),
        ("plumb_bob", (-0.1, 0.02, 0.001, 0.002, 0.003), "/cam/color/image_rect_color", None),
    ]
    for number, (model, coefficients, topic, lens) in enumerate(cases):
        bag = Recorder()
        for k in range(2):
            bag.image(topic, time_of(k), FRAME, "rgb8", rgb)
            bag.tf("/tf", time_of(k), bag.transform(time_of(k), "world", FRAME, np.eye(4)))
        p = np.array([60.0, 0, 30.5, 0, 0, 61.0, 23.5, 0, 0, 0, 1, 0])
        bag.info(RGB_INFO, camera, model=model, d=coefficients, p=p)
        frame: Any = open_dataset(bag.write(tmp_path / f"bag{number}", "mcap")).frames[0]
        if lens is None:
            assert frame.lens is None
        else:
            assert frame.lens == Lens(coefficients, fisheye=model == "equidistant")
            assert frame.read().mask is not None
        numbers = (frame.camera.fx, frame.camera.fy, frame.camera.cx, frame.camera.cy)
        if "rect" in topic:
            assert numbers == (60, 61, 31, 24)
        else:
            assert numbers == pytest.approx((camera.fx, camera.fy, camera.cx, camera.cy))
