"""What a robot's RGB-D camera delivers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gslts._core.fusion import register_depth
from gslts.core.camera import Camera, downscale

__all__ = ["Labels", "RgbdFrame", "halved_depth", "halved_mask", "halved_rgb", "register_depth"]

EDGE_SHARE = 0.05
"""A relative difference of depths within 2 x 2 pixels that shows an edge."""


@dataclass(frozen=True, eq=False)
class Labels:
    """Which object each pixel shows, where a simulator or a person knows it.

    Args:
        instances: [H,W] int32, row of the object in `types`; -1 where there is none.
        types: Of the objects, such as "Mug".

    Raises:
        ValueError: The array has a wrong shape or dtype, or names an object that there is not.
    """

    instances: NDArray[np.int32]
    types: tuple[str, ...]

    def __post_init__(self) -> None:
        if self.instances.dtype != np.int32 or self.instances.ndim != 2:
            raise ValueError(
                f"Labels: instances: expected int32 [H,W], got {self.instances.dtype} "
                f"{self.instances.shape}"
            )
        if self.instances.size and not (
            self.instances.min() >= -1 and self.instances.max() < len(self.types)
        ):
            raise ValueError(f"Labels: instances: must be in -1..{len(self.types) - 1}")


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
        labels: [H,W] what the pixels show; None if nobody told. A halved frame has none.
        fault: Why nothing may be concluded from it, such as that nobody knows where it was taken;
            None if nothing is known against it.

    Raises:
        ValueError: An array has a wrong shape or dtype, or a depth is negative or infinite.
    """

    rgb: NDArray[np.uint8]
    depth: NDArray[np.float32]
    camera: Camera
    time_s: float = 0.0
    depth_camera: Camera | None = None
    mask: NDArray[np.bool_] | None = None
    labels: Labels | None = None
    fault: str | None = None

    def __post_init__(self) -> None:
        size = (self.camera.height, self.camera.width)
        if self.labels is not None and self.labels.instances.shape != size:
            raise ValueError(
                f"RgbdFrame: labels: expected {size}, got {self.labels.instances.shape}"
            )
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
        return replace(self, depth=depth, depth_camera=None)

    def halved(self) -> RgbdFrame:
        """The same frame, registered, with half the sides; what is left over is cut off."""
        whole = self.registered()
        return RgbdFrame(
            halved_rgb(whole.rgb),
            halved_depth(whole.depth),
            downscale(whole.camera, 2),
            whole.time_s,
            mask=None if whole.mask is None else halved_mask(whole.mask),
            fault=whole.fault,
        )


def halved_rgb(rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """[H/2,W/2,3] means of 2 x 2 pixels, rounded."""
    total: NDArray[np.uint16] = _fours(rgb).sum(axis=0, dtype=np.uint16)
    return ((total + 2) // 4).astype(np.uint8)


def halved_depth(depth: NDArray[np.float32]) -> NDArray[np.float32]:
    """[H/2,W/2] means of 2 x 2 pixels where all are measured and on one surface, else 0."""
    four = _fours(depth)
    same = (four.min(axis=0) > 0) & (np.ptp(four, axis=0) < EDGE_SHARE * four.max(axis=0))
    return np.where(same, four.mean(axis=0), 0).astype(np.float32)


def halved_mask(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """[H/2,W/2] whether all of 2 x 2 pixels are wanted."""
    return np.asarray(_fours(mask).all(axis=0), np.bool_)


def _fours(image: NDArray[Any]) -> NDArray[Any]:
    """[4,H/2,W/2,...] the pixels of each block of 2 x 2; what is left over is cut off."""
    height, width = (length // 2 * 2 for length in image.shape[:2])
    part = image[:height, :width]
    return np.stack([part[::2, ::2], part[1::2, ::2], part[::2, 1::2], part[1::2, 1::2]])
