"""Frame in memory with the quantities that mapping refines: pose, lenses and exposure."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from gslts.core.camera import Camera, at_pose, downscale
from gslts.core.frame import RgbdFrame, halve_depth, halve_mask, halve_rgb, register_depth
from gslts.core.se3 import product, relative
from gslts.localization.alignment import Alignment
from gslts.mapping.lenses import Lenses
from gslts.rendering.losses import Exposure
from gslts.types import Bools, Bytes, Floats, Floats32

LEVELS = 3
"""Number of resolutions: full, half and quarter."""
BYTES_PER_PIXEL = 14
"""Memory of a frame: colours, depth and mask of all levels, and registered depth."""


@dataclass(eq=False)
class Observation:
    """A frame in several resolutions; level 0 is the full one, each next has half the sides.

    Attributes:
        rgb: [H,W,3] sRGB of each level.
        raw_depth: [H',W'] depth of each level in the frame of its lens, m; 0 is no measurement.
        masks: [H,W] of each level, True where the colour camera saw something; None is everywhere.
        given_world_from_depth: [4,4] pose of the depth lens by the data set.
        world_from_camera: [4,4] refined pose of the colour camera.
        lenses: Refined lenses of the sensor.
        exposure: Maps rendered colours to those of this frame.
        exposure_rejected: Whether the last fit was not plausible, so that `exposure` is an earlier
            one; see `gslts.mapping.exposures`.
        shows_known: Whether the frame shows so much of a fixed map that this determines `exposure`.
        alignment: Normal equations of pose and lenses at the last step of the optimizer.
    """

    rgb: tuple[Bytes, ...]
    raw_depth: tuple[Floats32, ...]
    masks: tuple[Bools, ...] | None
    given_world_from_depth: Floats
    world_from_camera: Floats
    lenses: Lenses
    exposure: Exposure = field(default_factory=Exposure)
    exposure_rejected: bool = False
    shows_known: bool = False
    alignment: Alignment | None = None
    _registered: tuple[int, Floats32] | None = None

    @classmethod
    def of(cls, frame: RgbdFrame) -> Observation:
        """Build the resolutions of a frame, at the pose of the data set.

        Args:
            frame: Full resolution; its depth may be unregistered.
        """
        rgb, raw_depth = [frame.rgb], [np.nan_to_num(frame.depth)]
        for _ in range(LEVELS - 1):
            rgb.append(halve_rgb(rgb[-1]))
            raw_depth.append(halve_depth(raw_depth[-1]))
        color = at_pose(frame.camera, np.eye(4))
        depth_lens = frame.depth_camera or frame.camera
        color_from_depth = relative(frame.camera.world_from_camera, depth_lens.world_from_camera)
        return cls(
            rgb=tuple(rgb),
            raw_depth=tuple(raw_depth),
            masks=None if frame.mask is None else _halve_masks(frame.mask),
            given_world_from_depth=depth_lens.world_from_camera,
            world_from_camera=frame.camera.world_from_camera,
            lenses=Lenses(
                color,
                color if frame.depth_camera is None else at_pose(depth_lens, color_from_depth),
            ),
        )

    @property
    def has_depth(self) -> bool:
        """True if depth was measured anywhere."""
        return bool(self.raw_depth[0].any())

    @property
    def given_pose(self) -> Floats:
        """World_from_camera [4,4] of the colour camera, by the data set and the lenses."""
        depth_from_color = relative(self.lenses.depth.world_from_camera, np.eye(4))
        return product(self.given_world_from_depth, depth_from_color)

    @property
    def correction(self) -> Floats:
        """Motion [4,4] of the refinement: given_pose @ correction is world_from_camera."""
        return relative(self.given_pose, self.world_from_camera)

    def at_pose(self, world_from_camera: Floats) -> Observation:
        """Return the observation at another pose.

        Args:
            world_from_camera: [4,4] of the colour camera.
        """
        return replace(self, world_from_camera=world_from_camera)

    def with_mask(self, mask: Bools) -> Observation:
        """Return the observation with a mask in addition to its own.

        Args:
            mask: [H,W] pixels that count, in full resolution.
        """
        own = self.mask()
        masks = _halve_masks(mask if own is None else own & mask)
        return replace(self, masks=masks, _registered=None)

    def set_lenses(self, lenses: Lenses) -> None:
        """Replace the lenses; depth is registered anew when it is next asked for.

        Args:
            lenses: Refined lenses of the sensor.
        """
        if lenses != self.lenses:
            self._registered = None
        self.lenses = lenses

    def camera(self, level: int = 0) -> Camera:
        """Return the colour camera at the refined pose.

        Args:
            level: Resolution.
        """
        return downscale(at_pose(self.lenses.color, self.world_from_camera), 1 << level)

    def color(self, level: int = 0) -> Floats32:
        """Return the colours [H,W,3], sRGB, 0 to 1.

        Args:
            level: Resolution.
        """
        return self.rgb[level].astype(np.float32) / np.float32(255)

    def mask(self, level: int = 0) -> Bools | None:
        """Return where [H,W] the colour camera saw something; None means everywhere.

        Args:
            level: Resolution.
        """
        return None if self.masks is None else self.masks[level]

    def depth(self, level: int = 0) -> Floats32:
        """Return the depth [H,W] registered to the colour camera, m; 0 outside the mask.

        It is cached for one level.

        Args:
            level: Resolution.
        """
        if self._registered is None or self._registered[0] != level:
            divisor = 1 << level
            depth_lens, color = (
                downscale(lens, divisor) for lens in (self.lenses.depth, self.lenses.color)
            )
            depth, mask = self.raw_depth[level], self.mask(level)
            if depth_lens != color:
                depth = register_depth(depth, depth_lens, color)
            self._registered = (
                level,
                depth if mask is None else np.where(mask, depth, np.float32(0)),
            )
        return self._registered[1]

    def rgbd(self, level: int = 0) -> RgbdFrame:
        """Return the frame with registered depth at the refined pose.

        Args:
            level: Resolution.
        """
        depth, camera, mask = self.depth(level), self.camera(level), self.mask(level)
        return RgbdFrame(self.rgb[level], depth, camera, mask=mask)


def _halve_masks(mask: Bools) -> tuple[Bools, ...]:
    """Return a mask in all resolutions."""
    masks = [mask]
    for _ in range(LEVELS - 1):
        masks.append(halve_mask(masks[-1]))
    return tuple(masks)
