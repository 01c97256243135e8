"""A frame as relocalization works with it: in several resolutions, without a pose."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gslts.core.frame import RgbdFrame
from gslts.types import Floats32

LEAST_SIDE_PX = 60
"""Of the coarsest picture, a pixel of which is about a degree: from there a pose is found that is
some degrees off."""

FARTHEST_M = 20.0
"""From the camera; beyond, a depth is none: sensors saturate at what 16 bits of mm hold."""
ENOUGH_PX = 320 * 240
"""Of a picture all of whose pixels count. Of a larger one about as many do, which cost less."""
BLOCK_PX = 32
"""Side of a block of pixels that count together: the rasterizer renders blocks."""


@dataclass(frozen=True, eq=False)
class Pictures:
    """One frame at full size, and halved as long as it stays large enough.

    Attributes:
        frames: Registered, the finest first.
        photos: [H,W,3] float32 sRGB of each, 0 to 1.
        depths: [H,W] float32 of each, m; 0 where there is none.
    """

    frames: tuple[RgbdFrame, ...]
    photos: tuple[Floats32, ...]
    depths: tuple[Floats32, ...]

    @classmethod
    def of(cls, frame: RgbdFrame, *, use_depth: bool = True) -> Pictures:
        """Halves a frame.

        Args:
            frame: Its pose does not count.
            use_depth: False means as if none had been measured.
        """
        frames = [frame.registered()]
        while min(frames[-1].rgb.shape[:2]) >= 2 * LEAST_SIDE_PX:
            frames.append(frames[-1].halved())
        photos = (one.rgb.astype(np.float32) / np.float32(255) for one in frames)
        depths = (_measured(one) * np.float32(use_depth) for one in frames)
        return cls(tuple(frames), tuple(photos), tuple(depths))

    def levels(self, halvings: int) -> range:
        """Halvings from the coarsest picture to one that is halved so often, if there is one."""
        coarsest = len(self.frames) - 1
        return range(coarsest, min(halvings, coarsest) - 1, -1)

    def spread(self, level: int) -> NDArray[np.bool_]:
        """[H,W] pixels that tell the pose: of those that saw something, blocks all over."""
        height, width = self.photos[level].shape[:2]
        step = max(1, round(math.sqrt(height * width / ENOUGH_PX)))
        rows, columns = np.arange(height) // BLOCK_PX, np.arange(width) // BLOCK_PX
        blocks: NDArray[np.bool_] = (rows % step == 0)[:, None] & (columns % step == 0)
        mask = self.frames[level].mask
        return blocks if mask is None else blocks & mask

    @property
    def has_depth(self) -> bool:
        """Whether anything was measured."""
        return bool(self.depths[0].any())


def _measured(frame: RgbdFrame) -> Floats32:
    """[H,W] depth of a registered frame, m; 0 where there is none, or nothing so near."""
    camera, depth = frame.camera, np.nan_to_num(frame.depth)
    across = (np.arange(camera.width) + 0.5 - camera.cx) / camera.fx
    down = (np.arange(camera.height) + 0.5 - camera.cy) / camera.fy
    metres = depth * np.sqrt(1 + across**2 + down[:, None] ** 2)
    return np.where(metres <= FARTHEST_M, depth, np.float32(0))
