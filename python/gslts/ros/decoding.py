"""Messages of a camera as an RGB-D frame."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from gslts.core.camera import Camera, at_pose
from gslts.core.frame import Labels, RgbdFrame
from gslts.datasets.dataset import pinhole
from gslts.datasets.ros.images import camera_of, depth_of, rgb_of, steps_of
from gslts.datasets.undistort import Lens, undistort_depth, undistort_rgb
from gslts.ros.config import Topics
from gslts.types import Floats

Decode = Callable[[str, bytes], Any]
"""Decodes a serialized message of a topic."""


@dataclass(frozen=True, eq=False)
class FrameMessages:
    """Serialized messages of one frame.

    Attributes:
        time_ns: Stamp of the colour image, ns.
        images: By topic.
        infos: CameraInfo by topic.
        label_names: Types of the labelled objects.
        world_from_camera: [4,4] pose of the colour camera, m.
        world_from_depth: [4,4] pose of the depth camera, m; None if the depth is registered.
    """

    time_ns: int
    images: Mapping[str, bytes]
    infos: Mapping[str, bytes]
    label_names: tuple[str, ...]
    world_from_camera: Floats
    world_from_depth: Floats | None = None


def decode_frame(messages: FrameMessages, topics: Topics, decode: Decode) -> RgbdFrame:
    """Decode the messages of a frame, and undo the distortion of the lenses.

    Args:
        messages: Of the frame.
        topics: Names of the topics.
        decode: Decodes a serialized message of a topic.

    Returns:
        The frame, stamped in seconds.

    Raises:
        ValueError: A message is damaged, or the images do not fit their CameraInfo.
    """
    infos = messages.infos
    camera, lens = _camera(topics.rgb_info, infos, decode, topics.is_rectified)
    camera = at_pose(camera, messages.world_from_camera)
    depth_camera, depth_lens = None, lens
    if messages.world_from_depth is not None:
        depth_camera, depth_lens = _camera(topics.depth_info, infos, decode, rectified=False)
        depth_camera = at_pose(depth_camera, messages.world_from_depth)
    rgb = rgb_of(decode(topics.rgb, messages.images[topics.rgb]))
    depth = depth_of(decode(topics.depth, messages.images[topics.depth]))
    _require_size(topics.rgb, rgb, camera)
    _require_size(topics.depth, depth, depth_camera or camera)
    mask = None
    if lens is not None:
        rgb, mask = undistort_rgb(rgb, camera, lens)
    if depth_lens is not None:
        depth = undistort_depth(depth, depth_camera or camera, depth_lens)
    labels = None
    if topics.labels and messages.label_names and lens is None:
        steps = steps_of(decode(topics.labels, messages.images[topics.labels]))
        labels = Labels(steps.astype(np.int32) - 1, messages.label_names)
    return RgbdFrame(rgb, depth, camera, messages.time_ns * 1e-9, depth_camera, mask, labels)


def _camera(
    topic: str, infos: Mapping[str, bytes], decode: Decode, rectified: bool
) -> tuple[Camera, Lens | None]:
    """Return a camera at the origin, and its lens."""
    try:
        intrinsics, size, lens = camera_of(decode(topic, infos[topic]), rectified)
        return pinhole(intrinsics, size, np.eye(4)), lens
    except ValueError as error:
        raise ValueError(f"{topic}: {error}") from None


def _require_size(topic: str, image: Any, camera: Camera) -> None:
    height, width = image.shape[:2]
    if (width, height) != (camera.width, camera.height):
        raise ValueError(
            f"{topic} has {width} x {height} px, and its CameraInfo {camera.width} x "
            f"{camera.height} px; depth that is not registered needs --depth-info"
        )
