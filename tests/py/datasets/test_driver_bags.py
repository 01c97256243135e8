"""Bags with the topics of camera drivers, as `ros2 bag record -a` writes them."""

import struct
from pathlib import Path

import numpy as np
import pytest
from recorded_frames import frames_of_robot
from reprojection import assert_frames_agree
from robot_bags import encoded, time_of
from ros_bags import MOUNT, OPTICAL, START_NS, Recorder, moving

from gslts.core.camera import Camera
from gslts.core.frame import RgbdFrame
from gslts.datasets import open_dataset

pytest.importorskip("rosbags")

COLOUR_FROM_DEPTH = np.eye(4)
"""The lens of the colour image beside that of the depth image."""
COLOUR_FROM_DEPTH[:3, 3] = (0.015, 0.001, -0.002)
POLYNOMIAL = {"model": "rational_polynomial", "d": [1e-6] * 8}


def small_frames() -> list[RgbdFrame]:
    """Frames at the poses of the depth camera, in its size."""
    return frames_of_robot(32, 24)


def add_tf(bag: Recorder, root: str, colour: str, depth: str, aligned: bool) -> None:
    """Add transforms of the driver, and the motion of the camera as odometry tells it."""
    to_colour = np.eye(4) if aligned else np.linalg.inv(COLOUR_FROM_DEPTH)
    bag.tf(
        "/tf_static",
        START_NS,
        bag.transform(0, "base_link", root, MOUNT),
        bag.transform(0, root, depth, OPTICAL),
        bag.transform(0, root, colour, OPTICAL @ to_colour),
    )
    for number, frame in enumerate(frames_of_robot()):
        base = frame.camera.world_from_camera @ np.linalg.inv(MOUNT @ OPTICAL)
        for offset in (-0.03, 0.05):
            moment = time_of(number) + round(1e9 * offset)
            motion = bag.transform(moment, "odom", "base_link", moving(base, offset))
            bag.tf("/tf", moment, motion)


def steps_of(depth: np.ndarray) -> np.ndarray:
    return np.rint(1000 * depth).astype("<u2")


def bgra(rgb: np.ndarray) -> np.ndarray:
    return np.dstack([rgb[..., ::-1], np.full(rgb.shape[:2], 255, np.uint8)])


def extrinsics(bag: Recorder, topic: str) -> None:
    """Add a message of a type that only the driver has."""
    from rosbags.typesys import get_types_from_msg

    kind = "realsense2_camera_msgs/msg/Extrinsics"
    bag.store.register(get_types_from_msg("float64[9] rotation\nfloat64[3] translation\n", kind))
    turn, shift = np.eye(3).ravel(), COLOUR_FROM_DEPTH[:3, 3].copy()
    bag.add(topic, START_NS, bag.make(kind, rotation=turn, translation=shift))


def realsense(bag: Recorder, aligned: bool) -> None:
    """Write the topics of realsense2_camera for ROS 2."""
    top, optical = "/camera/camera", "camera_{}_optical_frame"
    colour, depth = optical.format("color"), optical.format("depth")
    add_tf(bag, "camera_link", colour, depth, aligned)
    extrinsics(bag, f"{top}/extrinsics/depth_to_color")
    frames, small = frames_of_robot(), small_frames()
    for number, (frame, own) in enumerate(zip(frames, small, strict=True)):
        time = time_of(number)
        bag.image(f"{top}/color/image_raw", time, colour, "rgb8", frame.rgb)
        infrared = frame.rgb[..., 1]
        bag.image(f"{top}/infra1/image_rect_raw", time, depth, "mono8", infrared)
        steps = steps_of(own.depth)
        bag.image(f"{top}/depth/image_rect_raw", time + 5_000_000, depth, "16UC1", steps)
        if aligned:
            topic = f"{top}/aligned_depth_to_color/image_raw"
            bag.image(topic, time, colour, "16UC1", steps_of(frame.depth))
    for name, camera in (("color", frames[0].camera), ("depth", small[0].camera)):
        bag.info(f"{top}/{name}/camera_info", camera)
    bag.info(f"{top}/infra1/camera_info", small[0].camera)
    if aligned:
        bag.info(f"{top}/aligned_depth_to_color/camera_info", frames[0].camera)


def azure_kinect(bag: Recorder, aligned: bool) -> None:
    """Write the topics of Azure_Kinect_ROS_Driver, by its `docs/usage.md`."""
    colour, depth = "rgb_camera_link", "depth_camera_link"
    add_tf(bag, "camera_base", colour, depth, aligned)
    frames, small = frames_of_robot(), small_frames()
    for number, (frame, own) in enumerate(zip(frames, small, strict=True)):
        time = time_of(number)
        bag.image("/rgb/image_raw", time, colour, "bgra8", bgra(frame.rgb))
        bag.image("/depth/image_raw", time, depth, "32FC1", own.depth.astype("<f4"))
        bag.image("/ir/image_raw", time, depth, "mono16", np.full((24, 32), 800, "<u2"))
        if aligned:
            metres = frame.depth.astype("<f4")
            bag.image("/depth_to_rgb/image_raw", time, colour, "32FC1", metres)
            bag.image("/rgb_to_depth/image_raw", time, depth, "bgra8", bgra(own.rgb))
    for name in ("rgb", "depth", "ir", *(("depth_to_rgb", "rgb_to_depth") if aligned else ())):
        lens = frames if name in ("rgb", "depth_to_rgb") else small
        bag.info(f"/{name}/camera_info", lens[0].camera, **POLYNOMIAL)


def oak(bag: Recorder, aligned: bool) -> None:
    """Write the topics of depthai_ros_driver, compressed: its depth is aligned by default."""
    colour, depth = "oak_rgb_camera_optical_frame", "oak_right_camera_optical_frame"
    add_tf(bag, "oak", colour, depth, aligned)
    frames, small = frames_of_robot(), small_frames()
    for number, (frame, own) in enumerate(zip(frames, small, strict=True)):
        time = time_of(number)
        data = encoded(frame.rgb, "JPEG")
        bag.compressed("/oak/rgb/image_raw/compressed", time, colour, "rgb8; jpeg", data)
        steps = steps_of((frame if aligned else own).depth)
        data = struct.pack("<iff", 0, 0, 0) + encoded(steps, "PNG")
        bag.compressed(
            "/oak/stereo/image_raw/compressedDepth",
            time,
            colour if aligned else depth,
            "16UC1; compressedDepth png",
            data,
        )
        bag.image("/oak/left/image_rect", time, "oak_left", "mono8", frame.rgb[..., 1])
    bag.info("/oak/rgb/camera_info", frames[0].camera, **POLYNOMIAL)
    lens = (frames if aligned else small)[0].camera
    bag.info("/oak/stereo/camera_info", lens, **(POLYNOMIAL if aligned else {}))
    bag.info("/oak/left/camera_info", frames[0].camera)


def orbbec(bag: Recorder, aligned: bool) -> None:
    """Write the topics of OrbbecSDK_ROS2 (Femto): aligned depth has the same topic."""
    colour, depth = "camera_color_optical_frame", "camera_depth_optical_frame"
    add_tf(bag, "camera_link", colour, depth, aligned)
    frames, small = frames_of_robot(), small_frames()
    for number, (frame, own) in enumerate(zip(frames, small, strict=True)):
        time = time_of(number)
        bag.image("/camera/color/image_raw", time, colour, "rgb8", frame.rgb)
        steps = steps_of((frame if aligned else own).depth)
        topic = "/camera/depth/image_raw"
        bag.image(topic, time, colour if aligned else depth, "16UC1", steps)
        bag.image("/camera/ir/image_raw", time, depth, "mono16", np.full((24, 32), 800, "<u2"))
    bag.info("/camera/color/camera_info", frames[0].camera, **POLYNOMIAL)
    lens = (frames if aligned else small)[0].camera
    bag.info("/camera/depth/camera_info", lens, **(POLYNOMIAL if aligned else {}))
    bag.info("/camera/ir/camera_info", small[0].camera)


DRIVERS = [realsense, azure_kinect, oak, orbbec]


def same_lens(found: Camera, expected: Camera) -> bool:
    names = ("fx", "fy", "cx", "cy")
    return all(abs(getattr(found, name) - getattr(expected, name)) < 1e-9 for name in names)


@pytest.mark.parametrize("aligned", [True, False])
@pytest.mark.parametrize("driver", DRIVERS)
def test_bags_of_drivers(tmp_path: Path, driver: object, aligned: bool) -> None:
    bag = Recorder()
    driver(bag, aligned)
    dataset = open_dataset(bag.write(tmp_path / "bag", "mcap"))
    assert dataset.left_out == ()
    read = [frame.read() for frame in dataset.frames]
    for found, frame, own in zip(read, frames_of_robot(), small_frames(), strict=True):
        pose = frame.camera.world_from_camera
        assert same_lens(found.camera, frame.camera)
        assert np.median(np.abs(found.rgb.astype(int) - frame.rgb)) <= 3
        if aligned:
            assert found.depth_camera is None
            np.testing.assert_allclose(found.camera.world_from_camera, pose, atol=1e-6)
            difference = np.abs(found.depth - frame.depth)
            assert np.median(difference) < 0.001
        else:
            assert found.depth_camera is not None
            assert same_lens(found.depth_camera, own.camera)
            np.testing.assert_allclose(found.depth_camera.world_from_camera, pose, atol=1e-6)
            beside = pose @ np.linalg.inv(COLOUR_FROM_DEPTH)
            np.testing.assert_allclose(found.camera.world_from_camera, beside, atol=1e-6)
            assert np.median(np.abs(found.depth - own.depth)) < 0.001
    assert_frames_agree(read)
    assert_frames_agree([frame.registered() for frame in read])


@pytest.mark.parametrize("driver", DRIVERS)
def test_depth_that_is_not_aligned_needs_transforms(tmp_path: Path, driver: object) -> None:
    bag = Recorder()
    driver(bag, False)
    bag.messages = [message for message in bag.messages if message[1] != "/tf_static"]
    message = r"the depth is not aligned to the colours, .* not connected; record /tf_static too"
    with pytest.raises(ValueError, match=message):
        open_dataset(bag.write(tmp_path / "bag", "mcap"))


def test_a_camera_without_odometry_has_frames_without_poses(tmp_path: Path) -> None:
    bag = Recorder()
    realsense(bag, True)
    bag.messages = [message for message in bag.messages if message[1] != "/tf"]
    path = bag.write(tmp_path / "bag", "mcap")
    hint = r"no fixed frame .* gslts map --poses estimate finds poses by the images"
    with pytest.raises(ValueError, match=hint):
        open_dataset(path)
    assert len(open_dataset(path, posed=False).frames) == 3


def test_bags_of_ros_1_are_to_be_converted(tmp_path: Path) -> None:
    path = tmp_path / "kitchen.bag"
    path.write_bytes(b"#ROSBAG V2.0\n")
    with pytest.raises(
        ValueError, match=r"a bag of ROS 1: convert it with rosbags-convert --src kitc"
    ):
        open_dataset(path)


def test_depth_compressed_by_rvl_is_named(tmp_path: Path) -> None:
    bag = Recorder()
    oak(bag, True)
    for _, _, message in bag.messages:
        if getattr(message, "format", "").endswith("compressedDepth png"):
            message.format = "16UC1; compressedDepth rvl"
    frame = open_dataset(bag.write(tmp_path / "bag", "mcap")).frames[0]
    with pytest.raises(ValueError, match="compressedDepth rvl' is not supported: record raw depth"):
        frame.read()
