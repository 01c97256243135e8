"""Undistortion: images of a distorting lens as a pinhole camera would have taken them."""

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

BORDER_PX = 1e-3
"""Tolerance of rounding: positions this far outside the outermost pixel centres count as seen."""
FOLD_STEPS = 2000
"""Radii at which the distortion is tested for folding back: one per pixel of a large image."""


@dataclass(frozen=True)
class Lens:
    """Distortion of a lens, in the models of OpenCV.

    Args:
        coefficients: k1 k2 p1 p2, k1 k2 p1 p2 k3 or k1 k2 p1 p2 k3 k4 k5 k6 (Brown's model, the
            last with a denominator); for a fisheye k1 k2 k3 k4 (Kannala and Brandt 2006).
        fisheye: True for the fisheye model.

    Raises:
        ValueError: The number of coefficients is none of these, or one is not finite.
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

    def distort_radius(self, radius: Floats) -> Floats:
        """Return the distorted distance from the principal point, in focal lengths.

        Args:
            radius: [N] undistorted distances, sqrt(x^2 + y^2) / z.

        Returns:
            [N]; -inf where the model has a pole.
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
    """Make a lens; None for a pinhole.

    Args:
        coefficients: See `Lens`.
        fisheye: True for the fisheye model.

    Raises:
        ValueError: See `Lens`.
    """
    if not fisheye and not any(coefficients):
        return None  # A fisheye distorts also with zero coefficients: its radii are angles.
    return Lens(tuple(float(value) for value in coefficients), fisheye)


def undistort_rgb(
    rgb: NDArray[np.uint8], camera: Camera, lens: Lens
) -> tuple[NDArray[np.uint8], Mask]:
    """Undistort a colour image with bilinear interpolation.

    Args:
        rgb: [H,W,3] uint8.
        camera: Intrinsics of both the lens and the pinhole camera.
        lens: Distortion.

    Returns:
        [H,W,3] uint8, 0 outside the distorted image; and [H,W] bool, True inside.
    """
    import cv2

    x, y, seen = _source_pixels(*_key(camera), lens)
    flat: Any = cv2.remap(rgb, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    flat[~seen] = 0
    return flat, seen


def undistort_depth(depth: Floats32, camera: Camera, lens: Lens) -> Floats32:
    """Undistort a depth image with the nearest pixel, so that edges are not mixed.

    Args:
        depth: [H,W] float32, m.
        camera: Intrinsics of both the lens and the pinhole camera.
        lens: Distortion.

    Returns:
        [H,W] float32, m; 0 outside the distorted image.
    """
    import cv2

    x, y, seen = _source_pixels(*_key(camera), lens)
    flat: Any = cv2.remap(depth, x, y, cv2.INTER_NEAREST, borderMode=cv2.BORDER_REPLICATE)
    flat[~seen] = 0
    return flat  # type: ignore[no-any-return]


def _key(camera: Camera) -> tuple[tuple[float, float, float, float], tuple[int, int]]:
    return (camera.fx, camera.fy, camera.cx, camera.cy), (camera.width, camera.height)


@lru_cache(maxsize=4)
def _source_pixels(
    intrinsics: tuple[float, float, float, float], size: tuple[int, int], lens: Lens
) -> tuple[Floats32, Floats32, Mask]:
    """Return column and row [H,W] of each pixel in the distorted image, and if it lies inside.

    Columns and rows are OpenCV's: pixel centres are whole numbers.
    """
    import cv2

    fx, fy, cx, cy = intrinsics
    # Pixel centres: whole numbers in OpenCV, +0.5 in this project.
    matrix = np.array([[fx, 0, cx - 0.5], [0, fy, cy - 0.5], [0, 0, 1]])
    make_map: Any = (
        cv2.fisheye.initUndistortRectifyMap if lens.fisheye else (cv2.initUndistortRectifyMap)
    )
    coefficients = np.array(lens.coefficients)
    x, y = make_map(matrix, coefficients, np.eye(3), matrix, size, cv2.CV_32FC1)
    seen = (x >= -BORDER_PX) & (x <= size[0] - 1 + BORDER_PX)
    seen &= (y >= -BORDER_PX) & (y <= size[1] - 1 + BORDER_PX)

    # Far out the polynomials fold back, and would show the centre of the image once more.
    across = (np.arange(size[0]) + 0.5 - cx) / fx
    down = (np.arange(size[1]) + 0.5 - cy) / fy
    radius = np.hypot(across, down[:, None])
    steps = np.linspace(0, radius.max(), FOLD_STEPS)
    folds = np.flatnonzero(~(np.diff(lens.distort_radius(steps)) > 0))
    if len(folds):
        seen &= radius < steps[folds[0]]
    seen.setflags(write=False)  # Cached, and shared by the frames.
    return x, y, seen
