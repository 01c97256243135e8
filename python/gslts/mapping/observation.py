"""A frame as the mapping engine works with it, and what has been found out about it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from gslts.core.camera import Camera, at_pose, downscale
from gslts.core.frame import RgbdFrame, halve_depth, halve_mask, halve_rgb, register_depth
from gslts.core.se3 import product, relative
from gslts.localization.alignment import Alignment
from gslts.mapping.lenses import Lenses
from gslts.rendering.losses import Exposure
from gslts.types import Floats, Floats32

LEVELS = 3
"""Full, half and quarter resolution."""
BYTES_PER_PIXEL = 14
"""Of the memory that a frame takes: colours, depth and mask of all levels, registered depth."""


@dataclass(eq=False)
class Observation:
    """A frame in several resolutions; level 0 is the full one, and each next has half the sides.

    Attributes:
        rgb: [H,W,3] uint8 of each level.
        measured: [H',W'] depth of each level as its lens saw it, m; 0 where there is none.
        masks: [H,W] bool of each level, True where the colour camera saw something.
        given: World_from_depth_lens, as the data set says.
        pose: World_from_camera of the colour camera as corrected.
        lenses: Of the sensor, as corrected.
        exposure: From the map's colours to those of the frame.
        look: What the last look at the map said about pose and lenses.
    """

    rgb: tuple[NDArray[np.uint8], ...]
    measured: tuple[Floats32, ...]
    masks: tuple[NDArray[np.bool_], ...] | None
    given: Floats
    pose: Floats
    lenses: Lenses
    exposure: Exposure = field(default_factory=Exposure)
    look: Alignment | None = None
    _registered: tuple[int, Floats32] | None = None

    @classmethod
    def of(cls, frame: RgbdFrame) -> Observation:
        """A frame where the data set says that it was taken."""
        rgb, measured = [frame.rgb], [np.nan_to_num(frame.depth)]
        masks = None if frame.mask is None else [frame.mask]
        for _ in range(LEVELS - 1):
            rgb.append(halve_rgb(rgb[-1]))
            measured.append(halve_depth(measured[-1]))
            if masks is not None:
                masks.append(halve_mask(masks[-1]))
        color = at_pose(frame.camera, np.eye(4))
        depth_lens = frame.depth_camera or frame.camera
        color_from_depth = relative(frame.camera.world_from_camera, depth_lens.world_from_camera)
        return cls(
            rgb=tuple(rgb),
            measured=tuple(measured),
            masks=None if masks is None else tuple(masks),
            given=depth_lens.world_from_camera,
            pose=frame.camera.world_from_camera,
            lenses=Lenses(
                color,
                color if frame.depth_camera is None else at_pose(depth_lens, color_from_depth),
            ),
        )

    @property
    def given_pose(self) -> Floats:
        """[4,4] world_from_camera of the colour camera, as the data set and the lenses say."""
        depth_from_color = relative(self.lenses.depth.world_from_camera, np.eye(4))
        return product(self.given, depth_from_color)

    @property
    def correction(self) -> Floats:
        """[4,4] given_pose @ correction is the pose."""
        return relative(self.given_pose, self.pose)

    def set_lenses(self, lenses: Lenses) -> None:
        """Takes the sensor for another one."""
        if lenses != self.lenses:
            self._registered = None
        self.lenses = lenses

    def camera(self, level: int = 0) -> Camera:
        """Of the colours, at the corrected pose."""
        return downscale(at_pose(self.lenses.color, self.pose), 1 << level)

    def photo(self, level: int = 0) -> Floats32:
        """[H,W,3] sRGB, 0 to 1."""
        return self.rgb[level].astype(np.float32) / np.float32(255)

    def mask(self, level: int = 0) -> NDArray[np.bool_] | None:
        """[H,W] True where the colour camera saw something; None means everywhere."""
        return None if self.masks is None else self.masks[level]

    def depth(self, level: int = 0) -> Floats32:
        """[H,W] m, as the colour camera would have measured it; kept for the next call."""
        if self._registered is None or self._registered[0] != level:
            divisor = 1 << level
            depth_lens, color = (
                downscale(lens, divisor) for lens in (self.lenses.depth, self.lenses.color)
            )
            same = depth_lens == color
            depth = self.measured[level]
            self._registered = level, depth if same else register_depth(depth, depth_lens, color)
        return self._registered[1]

    def rgbd(self, level: int = 0) -> RgbdFrame:
        """Registered, and at the corrected pose."""
        depth, camera, mask = self.depth(level), self.camera(level), self.mask(level)
        return RgbdFrame(self.rgb[level], depth, camera, mask=mask)
