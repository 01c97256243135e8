"""What a robot's RGB-D camera delivers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gslts.camera import Camera


@dataclass(frozen=True, eq=False)
class RgbdFrame:
    """A colour and a depth image of one moment, registered pixel by pixel.

    Args:
        rgb: [H,W,3] uint8, sRGB.
        depth: [H,W] float32, z in the camera frame, m; 0 or NaN where there is no measurement.
        camera: Intrinsics and pose as the robot knows them, which may err.
        time_s: Of the picture, s, from any start.
        mask: [H,W] bool, True where the camera saw something; None means everywhere. Elsewhere,
            as beyond the border of an undistorted picture, neither colour nor depth counts.

    Raises:
        ValueError: An array has a wrong shape or dtype, or a depth is negative or infinite.
    """

    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32]
    camera: Camera
    time_s: float = 0.0
    mask: NDArray[np.bool_] | None = None

    def __post_init__(self) -> None:
        size = (self.camera.height, self.camera.width)
        for name, dtype, shape in (
            ("rgb", np.uint8, (*size, 3)),
            ("depth", np.float32, size),
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
