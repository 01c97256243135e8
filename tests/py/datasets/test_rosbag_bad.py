"""Bags of ROS 2 that are damaged or incomplete: what is rejected, and with which message."""

import struct
import sys
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recorded_frames import frames_of_robot
from robot_bags import DEPTH, FRAME, RGB, RGB_INFO, encoded, robot_bag, simple_bag, time_of
from ros_bags import START_NS, Recorder

from gslts.datasets import open_dataset
from gslts.io.image_files import MAX_PIXELS

pytest.importorskip("rosbags")


def write_changed(tmp_path: Path, change: Any) -> Path:
    bag = robot_bag(frames_of_robot())
    change(bag)
    return bag.write(tmp_path / "walk", "mcap")


def without(topic: str) -> Any:
    def change(bag: Recorder) -> None:
        bag.messages = [message for message in bag.messages if message[1] != topic]

    return change


def second_camera(bag: Recorder) -> None:
    bag.image("/rear/image_raw", START_NS, "rear", "rgb8", np.zeros((48, 64, 3), np.uint8))
    bag.info("/rear/camera_info", frames_of_robot()[0].camera)


def another_info(**changed: Any) -> Any:
    def change(bag: Recorder) -> None:
        without(RGB_INFO)(bag)
        bag.info(RGB_INFO, frames_of_robot()[0].camera, **changed)

    return change


def two_parents(bag: Recorder) -> None:
    bag.tf("/tf", START_NS, bag.transform(START_NS, "map", "base_link", np.eye(4)))


def a_loop(bag: Recorder) -> None:
    bag.tf("/tf_static", START_NS, bag.transform(0, "base_link", "map", np.eye(4)))


def test_a_bag_without_poses_has_frames_without_poses(tmp_path: Path) -> None:
    bag = robot_bag(frames_of_robot())
    without("/tf")(bag)
    dataset = open_dataset(bag.write(tmp_path / "bag", "mcap"), posed=False)
    assert len(dataset.frames) == len(frames_of_robot())
    assert dataset.unposed == dataset.frames
    assert "no fixed frame" in dataset.why_unposed
    read = dataset.frames[1].read()
    np.testing.assert_array_equal(read.rgb, frames_of_robot()[1].rgb)
    np.testing.assert_array_equal(read.camera.world_from_camera, np.eye(4))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (without(RGB), r"no colour images with a CameraInfo.*; topics: /cam/aligned"),
        (without(RGB_INFO), r"no colour images with a CameraInfo beside them; topics: .*\(sens"),
        (second_camera, r"several cameras have colour images: /cam/color/image_raw, /rear"),
        (without("/tf"), r"no fixed frame .* is above cam_color_optical in /tf; .* there are none"),
        (without("/tf_static"), r"no fixed frame .* is above cam_color_optical in /tf"),
        (two_parents, r"the frame base_link has two parents: odom \(moving\) and map \(moving\)"),
        (a_loop, r"the frames above cam_color_optical form a loop"),
        (another_info(k=np.zeros(9)), r"color/camera_info: a focal length of 0 px"),
        (another_info(width=50), r"principal point|expected 50"),
        (another_info(binning_x=2), r"binning and regions of interest are not supported"),
        (another_info(model="fov", d=[0.9]), r"the distortion model 'fov' is not supported"),
        (another_info(d=[0.1, 0.2]), r"plumb_bob has 2 coefficients"),
        (
            another_info(model="rational_polynomial", d=[0.1] * 12),
            r"rational_polynomial has more than 8 coefficients",
        ),
    ],
)
def test_bags_that_cannot_be_used_are_rejected(tmp_path: Path, change: Any, message: str) -> None:
    path = write_changed(tmp_path, change)
    with pytest.raises(ValueError, match=message) as caught:
        open_dataset(path).frames[0].read()
    assert str(path) in str(caught.value)


def test_damaged_images_are_named(tmp_path: Path) -> None:
    def cut(bag: Recorder) -> None:
        for _, topic, message in bag.messages:
            if topic == RGB:
                message.data = message.data[:-10]

    frame = open_dataset(write_changed(tmp_path, cut)).frames[0]
    with pytest.raises(ValueError, match=r"image_raw at \d+ ns: \d+ bytes in rows of 197 are"):
        frame.read()

    def damaged(bag: Recorder, time: int) -> None:
        data = encoded(np.zeros((48, 64, 3), np.uint8), "PNG")
        bag.compressed(f"{RGB}/compressed", time, FRAME, "rgb8; png compressed", data[:60])

    frame = simple_bag(tmp_path, damaged).frames[0]
    with pytest.raises(ValueError, match=r"image_raw/compressed at \d+ ns: "):
        frame.read()


def bomb(kind: str, width: int, height: int) -> bytes:
    """An image of 8 x 8 px that claims to have other sides."""
    data = bytearray(encoded(np.zeros((8, 8, 3), np.uint8), kind))
    if kind == "PNG":
        data[16:24] = struct.pack(">II", width, height)
        data[29:33] = struct.pack(">I", zlib.crc32(data[12:29]))
    else:
        sides = data.index(b"\xff\xc0") + 5  # In the header of the frame.
        data[sides : sides + 4] = struct.pack(">HH", height, width)
    return bytes(data)


@pytest.mark.parametrize("kind", ["PNG", "JPEG"])
@pytest.mark.parametrize("harm", ["huge", "large", "truncated", "garbage", "empty"])
def test_damaged_compressed_images_are_named(tmp_path: Path, kind: str, harm: str) -> None:
    harmed = {
        "huge": bomb(kind, 60_000, 60_000),
        "large": bomb(kind, 8200, 8200),
        "truncated": encoded(np.zeros((48, 64, 3), np.uint8), kind)[:-20],
        "garbage": encoded(np.zeros((48, 64, 3), np.uint8), kind)[:40] + b"?" * 500,
        "empty": b"",
    }[harm]
    message = {
        "huge": f"60000 x 60000 px, at most {MAX_PIXELS} pixels are read",
        "large": f"8200 x 8200 px, at most {MAX_PIXELS} pixels are read",
        "truncated": "the image is damaged",
    }.get(harm, "(the image is damaged|not an image)")

    def add(bag: Recorder, time: int) -> None:
        bag.compressed(f"{RGB}/compressed", time, FRAME, f"rgb8; {kind.lower()} compressed", harmed)
        bag.image(DEPTH, time, FRAME, "16UC1", np.ones((48, 64), "<u2"))

    frame = simple_bag(tmp_path, add).frames[0]
    with pytest.raises(ValueError, match=rf"image_raw/compressed at \d+ ns: {message}"):
        frame.read()


def test_damaged_compressed_depth_is_named(tmp_path: Path) -> None:
    def add(bag: Recorder, time: int) -> None:
        bag.image(RGB, time, FRAME, "rgb8", np.zeros((48, 64, 3), np.uint8))
        data = bytes(12) + bomb("PNG", 60_000, 60_000)
        kind = "16UC1; compressedDepth png"
        bag.compressed(f"{DEPTH}/compressedDepth", time, FRAME, kind, data)

    frame = simple_bag(tmp_path, add).frames[0]
    with pytest.raises(ValueError, match=r"compressedDepth at \d+ ns: 60000 x 60000 px, at"):
        frame.read()


def test_bags_are_named_from_inside(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = robot_bag(frames_of_robot()).write(tmp_path / "walk", "mcap")
    monkeypatch.chdir(path)
    assert open_dataset(".").name == "walk"


def test_depth_of_another_size_is_named_with_both_sizes(tmp_path: Path) -> None:
    def small(bag: Recorder) -> None:
        without(DEPTH)(bag)
        for number in range(3):
            bag.image(DEPTH, time_of(number), FRAME, "16UC1", np.ones((24, 32), "<u2"))

    frame = open_dataset(write_changed(tmp_path, small)).frames[0]
    with pytest.raises(ValueError, match=r": 32 x 24 px, expected 64 x 48"):
        frame.read()


@pytest.mark.parametrize("storage", ["sqlite3", "mcap"])
def test_truncated_bags_are_rejected(tmp_path: Path, storage: str) -> None:
    path = robot_bag(frames_of_robot()).write(tmp_path / "walk", storage)
    file = next(path.glob("walk.*"))
    whole = file.read_bytes()
    for size in (0, 20, len(whole) // 2):
        file.write_bytes(whole[:size])
        with pytest.raises((ValueError, OSError), match="walk"):
            [frame.read() for frame in open_dataset(path).frames]
    file.unlink()
    with pytest.raises((ValueError, OSError), match="walk"):
        open_dataset(path)
    (path / "metadata.yaml").write_text("rosbag2_bagfile_information: [")
    with pytest.raises(ValueError, match="walk"):
        open_dataset(path)


def test_what_is_missing_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = robot_bag(frames_of_robot()).write(tmp_path / "walk", "mcap")
    monkeypatch.setitem(sys.modules, "rosbags.rosbag2", None)
    with pytest.raises(ImportError, match=r"ROS bags need rosbags: pip install 'gslts\[ros\]'"):
        open_dataset(path)
