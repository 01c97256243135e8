"""Pictures as a pinhole would have taken them, from those of a lens that distorts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gslts.core.camera import Camera
from gslts.types import Floats, Floats32

Mask = NDArray[np.bool_]

BESIDE_PX = 1e-3
"""So far outside the middles of the outermost pixels a place still counts as seen: rounding."""
FOLD_STEPS = 2000


@dataclass(frozen=True)
class Lens:
    """How a lens bends light, in the models of OpenCV.

    Args:
        coefficients: k1 k2 p1 p2, k1 k2 p1 p2 k3 or k1 k2 p1 p2 k3 k4 k5 k6 (Brown's model, the
            last with a denominator); of a fisheye k1 k2 k3 k4 (Kannala and Brandt 2006).
        fisheye: Whether they are those of a fisheye.

    Raises:
        ValueError: Their number is none of these, or one is not finite.
    """

    coefficients: tuple[float, ...]
    fisheye: bool = False

    def __post_init__(self) -> None:
        numbers = (4,) if self.fisheye else (4, 5, 8)
        if len(self.coefficients) not in numbers:
            raise ValueError(
                f"the lens has {len(self.coefficients)} coefficients, expected one of {numbers}"
            )
        if not np.isfinite(self.coefficients).all():
            raise ValueError(f"the lens has coefficients {self.coefficients}")

    def bent(self, radius: Floats) -> Floats:
        """Distance from the middle of the image plane at which light from a direction arrives.

        Args:
            radius: Of the directions, x/z, without the lens.
        """
        c = self.coefficients
        if self.fisheye:
            angle = np.arctan(radius)
            s = angle**2
            return angle * (1 + s * (c[0] + s * (c[1] + s * (c[2] + s * c[3]))))
        k1, k2, k3, k4, k5, k6 = (*c[:2], *c[4:], *(0.0,) * (8 - len(c)))
        s = radius**2
        below = 1 + s * (k4 + s * (k5 + s * k6))
        above = radius * (1 + s * (k1 + s * (k2 + s * k3)))
        return np.divide(above, below, out=np.full_like(above, -np.inf), where=below > 0)


def lens_or_none(coefficients: Sequence[float], fisheye: bool = False) -> Lens | None:
    """A lens, or None for one that does not distort: a pinhole."""
    if not fisheye and not any(coefficients):
        return None  # A fisheye without coefficients is none: its angles are its radii.
    return Lens(tuple(float(value) for value in coefficients), fisheye)


def undistort_rgb(
    rgb: NDArray[np.uint8], camera: Camera, lens: Lens
) -> tuple[NDArray[np.uint8], Mask]:
    """What a pinhole with the same intrinsics would have seen, interpolated linearly.

    Args:
        rgb: [H,W,3] uint8.
        camera: Intrinsics of the lens, and of the pinhole.
        lens: Its distortion.

    Returns:
        The picture in the same size, 0 where the lens saw nothing, and [H,W] whether it did.
    """
    import cv2

    x, y, seen = _places(*_key(camera), lens)
    flat: Any = cv2.remap(rgb, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    flat[~seen] = 0
    return flat, seen


def undistort_depth(depth: Floats32, camera: Camera, lens: Lens) -> Floats32:
    """The same of depth, [H,W] float32 m, each from the next pixel: edges are not mixed."""
    import cv2

    x, y, seen = _places(*_key(camera), lens)
    flat: Any = cv2.remap(depth, x, y, cv2.INTER_NEAREST, borderMode=cv2.BORDER_REPLICATE)
    flat[~seen] = 0
    return flat  # type: ignore[no-any-return]


def _key(camera: Camera) -> tuple[tuple[float, float, float, float], tuple[int, int]]:
    return (camera.fx, camera.fy, camera.cx, camera.cy), (camera.width, camera.height)


@lru_cache(maxsize=4)
def _places(
    intrinsics: tuple[float, float, float, float], size: tuple[int, int], lens: Lens
) -> tuple[Floats32, Floats32, Mask]:
    """[H,W] each: column and row of each pixel in the distorted picture, and if it is in there.

    Columns and rows are OpenCV's: whole numbers are the middles of pixels.
    """
    import cv2

    fx, fy, cx, cy = intrinsics
    # OpenCV counts from the middle of the first pixel, this project from its corner.
    matrix = np.array([[fx, 0, cx - 0.5], [0, fy, cy - 0.5], [0, 0, 1]])
    make_map: Any = (
        cv2.fisheye.initUndistortRectifyMap if lens.fisheye else (cv2.initUndistortRectifyMap)
    )
    coefficients = np.array(lens.coefficients)
    x, y = make_map(matrix, coefficients, np.eye(3), matrix, size, cv2.CV_32FC1)
    seen = (x >= -BESIDE_PX) & (x <= size[0] - 1 + BESIDE_PX)
    seen &= (y >= -BESIDE_PX) & (y <= size[1] - 1 + BESIDE_PX)

    # Far out the polynomials turn back, and would show the middle of the picture once more.
    across = (np.arange(size[0]) + 0.5 - cx) / fx
    down = (np.arange(size[1]) + 0.5 - cy) / fy
    radius = np.hypot(across, down[:, None])
    steps = np.linspace(0, radius.max(), FOLD_STEPS)
    turns_back = np.flatnonzero(~(np.diff(lens.bent(steps)) > 0))
    if len(turns_back):
        seen &= radius < steps[turns_back[0]]
    seen.setflags(write=False)  # It is kept, and handed to each frame.
    return x, y, seen
