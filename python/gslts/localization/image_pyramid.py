"""Image pyramid of a frame for relocalization, which does not use its pose."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from gslts.core.frame import RgbdFrame
from gslts.localization.constants import (
    BLOCK_PX,
    MAX_DEPTH_M,
    MAX_USED_PX,
    MIN_FINEST_PX,
    MIN_SIDE_PX,
)
from gslts.types import Bools, Floats32


@dataclass(frozen=True, eq=False)
class ImagePyramid:
    """Frame at full size, and halved as long as it stays large enough.

    Attributes:
        frames: Registered frames, the finest first.
        colors: [H,W,3] sRGB of each, 0 to 1.
        depths: [H,W] of each, m; 0 where there is none.
    """

    frames: tuple[RgbdFrame, ...]
    colors: tuple[Floats32, ...]
    depths: tuple[Floats32, ...]

    @classmethod
    def of(cls, frame: RgbdFrame, *, use_depth: bool = True) -> ImagePyramid:
        """Halve a frame.

        Args:
            frame: Any pose.
            use_depth: False removes the depth.
        """
        frames = [frame.registered()]
        while min(frames[-1].rgb.shape[:2]) >= 2 * MIN_SIDE_PX:
            frames.append(frames[-1].halved())
        colors = (level.rgb.astype(np.float32) / np.float32(255) for level in frames)
        depths = (_near_depth(level) * np.float32(use_depth) for level in frames)
        return cls(tuple(frames), tuple(colors), tuple(depths))

    def levels(self, halvings: int) -> range:
        """Return the levels from the coarsest to the finest one that is used.

        Args:
            halvings: Level of the finest image, if the pyramid has it and it is wide enough.
        """
        coarsest = len(self.frames) - 1
        finest = min(halvings, coarsest)
        while finest > 0 and self.colors[finest].shape[1] < MIN_FINEST_PX:
            finest -= 1
        return range(coarsest, finest - 1, -1)

    def used_pixels(self, level: int) -> Bools:
        """Select the pixels that are compared: blocks spread over the valid part of an image.

        Args:
            level: Level of the pyramid, 0 the finest.

        Returns:
            [H,W] True where a pixel is compared.
        """
        height, width = self.colors[level].shape[:2]
        step = max(1, round(math.sqrt(height * width / MAX_USED_PX)))
        rows, columns = np.arange(height) // BLOCK_PX, np.arange(width) // BLOCK_PX
        blocks: Bools = (rows % step == 0)[:, None] & (columns % step == 0)
        mask = self.frames[level].mask
        return blocks if mask is None else blocks & mask

    @property
    def has_depth(self) -> bool:
        """True if any depth was measured."""
        return bool(self.depths[0].any())


def _near_depth(frame: RgbdFrame) -> Floats32:
    """Return [H,W] depth of a registered frame, m; 0 where none, or beyond `MAX_DEPTH_M`."""
    camera, depth = frame.camera, np.nan_to_num(frame.depth)
    across = (np.arange(camera.width) + 0.5 - camera.cx) / camera.fx
    down = (np.arange(camera.height) + 0.5 - camera.cy) / camera.fy
    metres = depth * np.sqrt(1 + across**2 + down[:, None] ** 2)
    return np.where(metres <= MAX_DEPTH_M, depth, np.float32(0))
