"""What a robot's RGB-D camera delivers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gslts._core.map import register_depth
from gslts.camera import Camera

__all__ = ["RgbdFrame", "register_depth"]


@dataclass(frozen=True, eq=False)
class RgbdFrame:
    """A colour and a depth image of one moment.

    Args:
        rgb: [H,W,3] uint8, sRGB.
        depth: [H',W'] float32, z in the frame of its camera, m; 0 or NaN where there is no
            measurement.
        camera: Intrinsics and pose of the colours as the robot knows them, which may err.
        time_s: Of the picture, s, from any start.
        depth_camera: Intrinsics and pose of the depth; None means that the depth is registered:
            pixel by pixel that of the colours.
        mask: [H,W] bool, True where the camera saw something; None means everywhere. Elsewhere,
            as beyond the border of an undistorted picture, neither colour nor depth counts.

    Raises:
        ValueError: An array has a wrong shape or dtype, or a depth is negative or infinite.
    """

    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32]
    camera: Camera
    time_s: float = 0.0
    depth_camera: Camera | None = None
    mask: NDArray[np.bool_] | None = None

    def __post_init__(self) -> None:
        size = (self.camera.height, self.camera.width)
        lens = self.camera if self.depth_camera is None else self.depth_camera
        depth_size = (lens.height, lens.width)
        for name, dtype, shape in (
            ("rgb", np.uint8, (*size, 3)),
            ("depth", np.float32, depth_size),
            ("mask", np.bool_, size),
        ):
            array = getattr(self, name)
            if array is None and name == "mask":
                continue
            if array.dtype != dtype or array.shape != shape:
                raise ValueError(
                    f"RgbdFrame: {name}: expected {np.dtype(dtype)} {shape}, got {array.dtype} "
                    f"{array.shape}"
                )
        if np.any(self.depth < 0) or np.any(np.isinf(self.depth)):
            raise ValueError("RgbdFrame: depth: must be finite and not negative, or NaN")

    def registered(self) -> RgbdFrame:
        """The same frame, its depth as the colour camera would have measured it."""
        if self.depth_camera is None:
            return self
        depth = register_depth(self.depth, self.depth_camera, self.camera)
        return RgbdFrame(self.rgb, depth, self.camera, self.time_s, mask=self.mask)
