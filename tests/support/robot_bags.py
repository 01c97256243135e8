"""Bags of a robot that walks through a small room."""

import io
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from recorded_frames import frames_of_robot
from ros_bags import MAP_FROM_ODOM, MOUNT, OPTICAL, START_NS, Recorder, moving

from gslts.core.frame import RgbdFrame
from gslts.datasets import Dataset, open_dataset

RGB, DEPTH = "/cam/color/image_raw", "/cam/aligned_depth_to_color/image_raw"
RGB_INFO, DEPTH_INFO = "/cam/color/camera_info", "/cam/aligned_depth_to_color/camera_info"
STEP_NS = 1_000_000_000
FRAME = "cam_color_optical"
BASE_FROM_OPTICAL = MOUNT @ OPTICAL


def time_of(number: int) -> int:
    """Return the time of a frame, ns."""
    return START_NS + number * STEP_NS


def add_images(bag: Recorder, frames: list[RgbdFrame]) -> None:
    """Add colours, depth and both cameras."""
    for number, frame in enumerate(frames):
        bag.image(RGB, time_of(number), FRAME, "rgb8", frame.rgb, pad=5)
        steps = np.rint(1000 * frame.depth).astype("<u2")
        bag.image(DEPTH, time_of(number) + 15_000_000, FRAME, "16UC1", steps)
    for topic in (RGB_INFO, DEPTH_INFO):
        bag.info(topic, frames[0].camera)


def add_mount(bag: Recorder) -> None:
    """Add the transforms from the base to the camera's optical frame."""
    bag.tf(
        "/tf_static",
        START_NS,
        bag.transform(0, "base_link", "cam_link", MOUNT),
        bag.transform(0, "cam_link", FRAME, OPTICAL),
    )


def add_tf(bag: Recorder, frames: list[RgbdFrame]) -> None:
    """Each frame's pose is between two transforms, 30 ms before and 50 ms after it."""
    add_mount(bag)
    for number, frame in enumerate(frames):
        time = time_of(number)
        base = (
            np.linalg.inv(MAP_FROM_ODOM)
            @ frame.camera.world_from_camera
            @ np.linalg.inv(BASE_FROM_OPTICAL)
        )
        for offset in (-0.03, 0.05):
            moment = time + round(1e9 * offset)
            odom = bag.transform(moment, "odom", "base_link", moving(base, offset))
            bag.tf("/tf", moment, odom, bag.transform(moment, "map", "odom", MAP_FROM_ODOM))


def robot_bag(frames: list[RgbdFrame]) -> Recorder:
    """Return a bag with images and poses of all frames."""
    bag = Recorder()
    add_images(bag, frames)
    add_tf(bag, frames)
    return bag


def simple_bag(tmp_path: Path, images: Any, storage: str = "mcap") -> Dataset:
    """Two frames of a standing camera, whose images a function adds."""
    bag = Recorder()
    camera = frames_of_robot()[0].camera
    for number in range(2):
        images(bag, time_of(number))
        moment = time_of(number)
        bag.tf("/tf", moment, bag.transform(moment, "world", FRAME, np.eye(4)))
    bag.info(RGB_INFO, camera)
    return open_dataset(bag.write(tmp_path / "bag", storage))


def encoded(pixels: np.ndarray, kind: str) -> bytes:
    """Return pixels as a file of Pillow's format `kind`."""
    file = io.BytesIO()
    Image.fromarray(pixels).save(file, kind, **({"quality": 95} if kind == "JPEG" else {}))
    return file.getvalue()
