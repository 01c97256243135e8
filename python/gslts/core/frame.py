"""RGB-D frames: colour, depth, camera, and what is known about them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gslts._core.fusion import register_depth
from gslts.core.camera import Camera, downscale

__all__ = ["Labels", "RgbdFrame", "halve_depth", "halve_mask", "halve_rgb", "register_depth"]

EDGE_SHARE = 0.05
"""Relative difference of depths within 2 x 2 pixels above which they are an edge, not averaged.
At half, slanted surfaces lose depth; at double, edges of flat objects are smeared."""
MIN_COMPLETE_SHARE = 0.5
"""Minimum share of blocks of 2 x 2 pixels with four depths among those with any; with less, depth
has holes all over. Frames of four real rooms have at least 0.67 down to 160 px, but with three of
four rows and columns it is 0.25. At half, 20 % of holes at random take 60 % of the depth; at
double, edges in halved images count as holes, and are filled."""


@dataclass(frozen=True, eq=False)
class Labels:
    """Ground truth of the object that each pixel shows, from a simulator or a person.

    Args:
        instances: [H,W] int32, index of the object in `types`; -1 for no object.
        types: Type of each object, such as "Mug".

    Raises:
        ValueError: The array has a wrong shape or dtype, or an index is out of range.
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
    """A colour image and a depth image taken at the same time.

    Args:
        rgb: [H,W,3] uint8, sRGB.
        depth: [H',W'] float32, z in the frame of its camera, m; 0 or NaN where there is no
            measurement.
        camera: Intrinsics and pose of the colour image as the robot believes them.
        time_s: Time stamp, s, from any start.
        depth_camera: Intrinsics and pose of the depth image; None means that the depth is
            registered to the colour image, pixel by pixel.
        mask: [H,W] bool, True where the camera saw something; None means everywhere. Other pixels,
            such as beyond the border of an undistorted image, are ignored.
        labels: Ground truth of the objects; None if unknown. A halved frame has none.
        fault: Reason why nothing may be concluded from this frame, such as an unknown pose; None
            if there is none.

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
        """Return the frame with its depth registered to the colour image, 0 outside the mask."""
        depth = self.depth
        if self.depth_camera is not None:
            depth = register_depth(depth, self.depth_camera, self.camera)
        if self.mask is not None and depth[~self.mask].any():
            depth = np.where(self.mask, depth, np.float32(0))
        return self if depth is self.depth else replace(self, depth=depth, depth_camera=None)

    def halved(self) -> RgbdFrame:
        """Return the registered frame at half the width and height, rounded down."""
        registered = self.registered()
        half = RgbdFrame(
            halve_rgb(registered.rgb),
            halve_depth(registered.depth),
            downscale(registered.camera, 2),
            registered.time_s,
            mask=None if registered.mask is None else halve_mask(registered.mask),
            fault=registered.fault,
        )
        return half.registered()  # Blocks at the border of the mask may have a depth.


def halve_rgb(rgb: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Average blocks of 2 x 2 pixels.

    Args:
        rgb: [H,W,3] uint8.

    Returns:
        [H/2,W/2,3] uint8, rounded.
    """
    total: NDArray[np.uint16] = _blocks(rgb).sum(axis=0, dtype=np.uint16)
    return ((total + 2) // 4).astype(np.uint8)


def halve_depth(depth: NDArray[np.float32]) -> NDArray[np.float32]:
    """Average blocks of 2 x 2 pixels that lie on one surface.

    All four pixels must be measured, but for depth with holes all over, such as that of a small
    image which was registered to a larger one: of that, any pixel of a block will do.

    Args:
        depth: [H,W] float32, m; 0 or NaN where there is no measurement.

    Returns:
        [H/2,W/2] float32, m; 0 where too few pixels were measured or depths differ by `EDGE_SHARE`.
    """
    block = _blocks(depth)
    is_complete, is_measured = block.min(axis=0) > 0, (block > 0).any(axis=0)
    if is_complete.sum() < MIN_COMPLETE_SHARE * is_measured.sum():
        return _halve_sparse_depth(depth)
    is_same = is_complete & (np.ptp(block, axis=0) < EDGE_SHARE * block.max(axis=0))
    return np.where(is_same, block.mean(axis=0), 0).astype(np.float32)


def halve_mask(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return where all of 2 x 2 pixels are set.

    Args:
        mask: [H,W] bool.

    Returns:
        [H/2,W/2] bool.
    """
    return np.asarray(_blocks(mask).all(axis=0), np.bool_)


def _halve_sparse_depth(depth: NDArray[np.float32]) -> NDArray[np.float32]:
    """Average what was measured in blocks of 2 x 2 pixels, if the pixels around are no edge.

    Between foreground and background is an edge, which holes may hide.
    """
    depth = np.nan_to_num(depth)
    block, around = _blocks(depth), _blocks(depth, margin=1)
    counts, farthest = (block > 0).sum(axis=0), around.max(axis=0)
    nearest = np.where(around > 0, around, farthest).min(axis=0)
    is_same = (counts > 0) & (farthest - nearest < EDGE_SHARE * farthest)
    return np.where(is_same, block.sum(axis=0) / np.maximum(counts, 1), 0).astype(np.float32)


def _blocks(image: NDArray[Any], margin: int = 0) -> NDArray[Any]:
    """Return the pixels [P,H/2,W/2,...] of blocks of 2 x 2, and those in a margin around each.

    An odd row or column is cut off; beyond the border is 0.
    """
    height, width = (length // 2 * 2 for length in image.shape[:2])
    part = image[:height, :width]
    if margin > 0:
        part = np.pad(part, margin)
    sides = range(2 + 2 * margin)
    return np.stack([part[y : y + height : 2, x : x + width : 2] for x in sides for y in sides])
