"""Images for people: colour, depth, error and heat as 8-bit RGB, with boxes and text."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gslts._core.map import Camera

RgbImage = NDArray[np.uint8]
"""[H,W,3] uint8, sRGB."""

NO_DEPTH = (40, 40, 40)
"""RGB of pixels without depth: dark grey, which the colour map does not have."""
DEPTH_COLORS, ERROR_COLORS, HEAT_COLORS = "turbo_r", "inferno", "turbo"
"""Colour maps of OpenCV, `_r` reversed: near is red, far blue; no error is black; hot is red."""
MIN_BOX_DEPTH_M = 0.05
"""Distance to the camera below which boxes are not drawn, m; their projection would diverge."""


def to_rgb8(rgb: NDArray[np.floating]) -> RgbImage:
    """Convert rendered colours to 8 bits.

    Args:
        rgb: [H,W,3] colours, clipped to 0 to 1.

    Returns:
        [H,W,3] uint8.
    """
    result: RgbImage = np.rint(255 * rgb.clip(0, 1)).astype(np.uint8)
    return result


def depth_range(depths: NDArray[np.floating]) -> tuple[float, float]:
    """Return the 2 % and 98 % quantiles of measured depths, m; (0, 1) without any.

    Args:
        depths: Array of any shape, m; 0 or NaN where there is no measurement.
    """
    measured = depths[depths > 0]
    if measured.size == 0:
        return 0.0, 1.0
    near_m, far_m = (float(value) for value in np.quantile(measured, (0.02, 0.98)))
    return near_m, max(far_m, near_m + 0.01)


def depth_image(depth: NDArray[np.floating], range_m: tuple[float, float]) -> RgbImage:
    """Colour a depth image; dark grey where there is no measurement.

    Args:
        depth: [H,W], m; 0 or NaN where there is no measurement.
        range_m: Depths shown in red and in blue, m.

    Returns:
        [H,W,3] uint8.
    """
    near_m, far_m = range_m
    seen = depth > 0
    shares = (np.where(seen, depth, near_m) - near_m) / (far_m - near_m)
    return np.where(seen[..., None], _colorize(shares, DEPTH_COLORS), np.array(NO_DEPTH, np.uint8))


def error_image(rgb: RgbImage, expected: RgbImage, brightest: float) -> RgbImage:
    """Colour the difference of two images.

    Args:
        rgb: [H,W,3] uint8.
        expected: [H,W,3] uint8.
        brightest: Mean absolute difference of the channels that gets the brightest colour, 0 to 1.

    Returns:
        [H,W,3] uint8.
    """
    error = np.abs(rgb.astype(np.float32) - expected.astype(np.float32)).mean(axis=2)
    return _colorize(error / (255 * brightest), ERROR_COLORS)


def draw_text(
    image: RgbImage, text: str, position: tuple[int, int], color: tuple[int, int, int]
) -> None:
    """Draw a line of text with a dark outline into an image.

    Args:
        image: [H,W,3] uint8, changed in place.
        text: ASCII characters.
        position: Column and row of the lower left corner, px; moved to the left if the text would
            not fit.
        color: RGB.
    """
    import cv2

    (width, _), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, 0.4, 3)
    position = (max(0, min(position[0], image.shape[1] - width)), position[1])
    for ink, thickness in (((0, 0, 0), 3), (color, 1)):
        cv2.putText(
            image, text, position, cv2.FONT_HERSHEY_SIMPLEX, 0.4, ink, thickness, cv2.LINE_AA
        )


def box_corners(box: NDArray[np.floating]) -> NDArray[np.float64]:
    """Return the corners of an axis-aligned box; ends of an edge differ in one bit of the row.

    Args:
        box: [2,3] lower and upper corner, m.

    Returns:
        [8,3] corners, m.
    """
    rows = (np.arange(8)[:, None] >> np.arange(3)) & 1
    return np.asarray(box[rows, np.arange(3)], np.float64)


def draw_box(
    image: RgbImage,
    corners: NDArray[np.floating],
    camera: Camera,
    color: tuple[int, int, int],
    scale: int = 1,
) -> None:
    """Draw the edges of a box, unless it reaches behind the camera.

    Args:
        image: [H,W,3] uint8, changed in place.
        corners: [8,3] in the world, m, in the order of `box_corners`.
        camera: Camera of the image.
        color: RGB.
        scale: Pixels of the image per pixel of the camera.
    """
    import cv2

    pose = camera.world_from_camera
    x, y, z = ((corners - pose[:3, 3]) @ pose[:3, :3]).T
    if (z < MIN_BOX_DEPTH_M).any():
        return
    pixels = np.stack([camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy], axis=1)
    ends = (scale * pixels).round().clip(-9999, 9999).astype(int).tolist()
    for start in range(8):
        for end in (start | 1, start | 2, start | 4):
            if end != start:
                cv2.line(image, ends[start], ends[end], color, 1, cv2.LINE_AA)


def legend(colors: str, width: int = 256, height: int = 12) -> RgbImage:
    """Return a strip with the colours of a colour map, from left to right.

    Args:
        colors: Name of a colour map of OpenCV, with `_r` for its reverse.
        width: px.
        height: px.

    Returns:
        [H,W,3] uint8.
    """
    shares = (np.arange(width) + 0.5) / width
    return _colorize(np.tile(shares, (height, 1)), colors)


def heat_image(rgb: RgbImage, shares: NDArray[np.floating]) -> RgbImage:
    """Blend a grey image with the colours of a heat map.

    Args:
        rgb: [H,W,3] uint8.
        shares: [H,W] heat, 0 to 1.

    Returns:
        [H,W,3] uint8.
    """
    grey = np.repeat(rgb.mean(axis=2, keepdims=True), 3, axis=2)
    weights = shares.clip(0, 1)[..., None]
    mixed = (1 - weights) * grey + weights * _colorize(shares, HEAT_COLORS)
    result: RgbImage = np.rint(mixed).astype(np.uint8)
    return result


def _colorize(shares: NDArray[np.floating], colors: str) -> RgbImage:
    import cv2

    levels = np.rint(255 * shares.clip(0, 1)).astype(np.uint8)
    if colors.endswith("_r"):
        levels = 255 - levels
    code = getattr(cv2, f"COLORMAP_{colors.removesuffix('_r').upper()}")
    return np.ascontiguousarray(cv2.applyColorMap(levels, code)[..., ::-1])
