"""Keypoints and points of a frame, by which it is registered with other frames."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

from gslts._core import reloc as _core
from gslts.core.camera import Camera, at_pose, unproject
from gslts.core.frame import RgbdFrame
from gslts.localization.clouds import depth_points
from gslts.localization.constants import CLOUD_LEVEL
from gslts.localization.image_pyramid import ImagePyramid
from gslts.localization.landmark_extraction import gray_image
from gslts.trajectory.constants import KEYPOINTS, MAX_CLOUD_PX, MAX_FEATURE_DEPTH_M
from gslts.types import Bytes, Floats32


@dataclass(frozen=True, eq=False)
class FrameFeatures:
    """Part of a frame that is kept for its registration.

    Attributes:
        camera: Intrinsics; the pose is the identity.
        pixels: [M,2] keypoints with measured depth, px.
        descriptors: [M,32] ORB.
        depths: [M] z in the camera frame, m.
        cloud: [P,3] measured points in the camera frame, m.
        seen_m: [H',W'] depth up to which each pixel of a small image saw through the scene, m: the
            nearest one around it; 0 where nothing was measured.
    """

    camera: Camera
    pixels: Floats32
    descriptors: Bytes
    depths: Floats32
    cloud: Floats32
    seen_m: Floats32

    @classmethod
    def of(cls, frame: RgbdFrame) -> FrameFeatures:
        """Extract the keypoints of a frame.

        Args:
            frame: Its pose is not used.
        """
        pyramid = ImagePyramid.of(frame)
        full, depth = pyramid.frames[0], pyramid.depths[0]
        valid = (depth > 0) & (depth < MAX_FEATURE_DEPTH_M)
        if full.mask is not None:
            valid &= full.mask
        rule = _core.FeatureRule(count=KEYPOINTS)
        pixels, descriptors = _core.features_of(gray_image(full.rgb), valid, rule)
        columns, rows = np.floor(pixels).astype(np.intp).T
        depths = np.ascontiguousarray(depth[rows, columns])
        camera = at_pose(full.camera, np.eye(4))
        level = _cloud_level(pyramid)
        cloud = depth_points(pyramid, level).astype(np.float32)
        seen_m = _seen_through(pyramid.depths[level])
        return cls(camera, pixels, descriptors, depths, cloud, seen_m)

    @cached_property
    def index(self) -> _core.LandmarkIndex:
        """Index of the keypoints, by their descriptors: 3 MB, kept until `drop_index`."""
        return _core.LandmarkIndex(self.points, self.descriptors, np.zeros(self.size, np.int32))

    def drop_index(self) -> None:
        """Free the memory of the index; it is built again if it is needed."""
        self.__dict__.pop("index", None)

    @property
    def size(self) -> int:
        """Number of keypoints."""
        return len(self.pixels)

    @property
    def points(self) -> Floats32:
        """Keypoints [M,3] in the camera frame, m."""
        points = unproject(
            self.camera, self.pixels.astype(np.float64), self.depths.astype(np.float64)
        )
        return points.astype(np.float32)


def _cloud_level(pyramid: ImagePyramid) -> int:
    """Return the level of the pyramid that the cloud of a frame is made of."""
    coarsest = len(pyramid.depths) - 1
    level = min(CLOUD_LEVEL, coarsest)
    while level < coarsest and pyramid.depths[level].size > MAX_CLOUD_PX:
        level += 1
    return level


def _seen_through(depth: Floats32) -> Floats32:
    """Return the nearest depth around each pixel, m, so that edges may be a pixel off."""
    far = np.where(depth > 0, depth, np.float32(np.inf))
    nearest = cv2.erode(far, np.ones((3, 3), np.uint8))
    return np.where((depth > 0) & np.isfinite(nearest), nearest, 0).astype(np.float32)
