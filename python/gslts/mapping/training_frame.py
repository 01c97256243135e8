"""A frame to learn from, and what has been found out about it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gslts.alignment import Alignment
from gslts.camera import Camera, at_pose, resized
from gslts.frame import RgbdFrame, register_depth
from gslts.losses import Exposure
from gslts.mapping.lenses import Lenses

Floats = NDArray[np.float64]
Floats32 = NDArray[np.float32]

LEVELS = 3
"""Full, half and quarter resolution."""
EDGE_SHARE = 0.05
"""A relative difference of depths within 2 x 2 pixels that shows an edge."""


def lenses_of(frame: RgbdFrame) -> Lenses:
    """The sensor that took a frame, as the data set gives it."""
    camera, depth = frame.camera, frame.depth_camera or frame.camera
    depth_from_world = np.linalg.inv(camera.world_from_camera)
    return Lenses(
        color=at_pose(camera, np.eye(4)),
        depth=at_pose(depth, depth_from_world @ depth.world_from_camera),
    )


@dataclass(eq=False)
class TrainingFrame:
    """A frame at three resolutions.

    Attributes:
        rgb: [H,W,3] uint8 at full, half and quarter resolution.
        measured: [H',W'] depth as its lens saw it, m, in as many resolutions; 0 where there is none.
        given: Pose of the depth lens, as the data set says.
        pose: Pose of the colour camera as corrected.
        lenses: Of the sensor, as corrected.
        exposure: From the map's colours to those of the frame.
        look: What the last look said.
    """

    rgb: tuple[NDArray[np.uint8], ...]
    measured: tuple[Floats32, ...]
    given: Floats
    pose: Floats
    lenses: Lenses
    exposure: Exposure = field(default_factory=Exposure)
    look: Alignment | None = None
    _depth: dict[int, Floats32] = field(default_factory=dict)

    @classmethod
    def of(cls, frame: RgbdFrame) -> TrainingFrame:
        """Where the data set says that it was taken."""
        rgb, depth = [frame.rgb], [np.nan_to_num(frame.depth)]
        for _ in range(LEVELS - 1):
            rgb.append(_halved(rgb[-1]))
            depth.append(_halved_depth(depth[-1]))
        lenses = lenses_of(frame)
        pose = frame.camera.world_from_camera
        given = pose @ lenses.depth.world_from_camera
        return cls(tuple(rgb), tuple(depth), given, pose, lenses)

    def off(self) -> Floats:
        """[4,4] motion in the colour camera's frame that takes the depth lens where it is said."""
        motion: Floats = (
            np.linalg.inv(self.pose)
            @ self.given
            @ np.linalg.inv(self.lenses.depth.world_from_camera)
        )
        return motion

    def rgbd(self) -> RgbdFrame:
        """Registered, and at the corrected pose."""
        return RgbdFrame(self.rgb[0], self.depth(0), self.camera())

    def set_lenses(self, lenses: Lenses) -> None:
        """Takes the sensor for another one."""
        self.lenses = lenses
        self._depth.clear()

    def camera(self, level: int = 0) -> Camera:
        """Of the colours, 0 at full and 1 at half resolution."""
        return resized(self.lenses.at(self.pose), 1 << level)

    def photo(self, level: int) -> Floats32:
        """[H,W,3] 0 to 1."""
        return self.rgb[level].astype(np.float32) / np.float32(255)

    def depth(self, level: int) -> Floats32:
        """[H,W] m, as the colour camera would have measured it."""
        if level not in self._depth:
            lenses, divisor = self.lenses, 1 << level
            depth = register_depth(
                self.measured[level], resized(lenses.depth, divisor), resized(lenses.color, divisor)
            )
            self._depth = {level: depth}
        return self._depth[level]


def _halved(rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
    height, width = (length // 2 * 2 for length in rgb.shape[:2])
    part = rgb[:height, :width].astype(np.uint16)
    total = part[::2, ::2] + part[1::2, ::2] + part[::2, 1::2] + part[1::2, 1::2]
    return ((total + 2) // 4).astype(np.uint8)


def _halved_depth(depth: Floats32) -> Floats32:
    """Means of 2 x 2 pixels where all are measured and on one surface, else 0."""
    height, width = (length // 2 * 2 for length in depth.shape)
    part = depth[:height, :width]
    four = np.stack([part[::2, ::2], part[1::2, ::2], part[::2, 1::2], part[1::2, 1::2]])
    same = (four.min(axis=0) > 0) & (np.ptp(four, axis=0) < EDGE_SHARE * four.max(axis=0))
    return np.where(same, four.mean(axis=0), 0).astype(np.float32)
