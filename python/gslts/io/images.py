"""Colours and depths as pictures for people."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gslts._core.map import Camera

Picture = NDArray[np.uint8]
"""[H,W,3] sRGB."""

NO_DEPTH = (40, 40, 40)
DEPTH_COLORS, ERROR_COLORS, HEAT_COLORS = "turbo_r", "inferno", "turbo"
"""Colour maps of matplotlib: near is red and far is blue; no error is black; hot is red."""

NEAREST_M = 0.05
"""No edge is drawn nearer to a camera."""


def picture_of(rgb: NDArray[np.floating]) -> Picture:
    """[H,W,3] rendered colours, clipped to 0 to 1."""
    result: Picture = np.rint(255 * rgb.clip(0, 1)).astype(np.uint8)
    return result


def depth_range(depths: NDArray[np.floating]) -> tuple[float, float]:
    """Nearest and farthest of most of the measured depths, m; (0, 1) if none is measured.

    Args:
        depths: Of any shape, m; 0 or NaN where there is no measurement.
    """
    measured = depths[depths > 0]
    if measured.size == 0:
        return 0.0, 1.0
    near_m, far_m = (float(value) for value in np.quantile(measured, (0.02, 0.98)))
    return near_m, max(far_m, near_m + 0.01)


def depth_picture(depth: NDArray[np.floating], range_m: tuple[float, float]) -> Picture:
    """Depth in colours, dark grey where there is no measurement.

    Args:
        depth: [H,W], m; 0 or NaN where there is no measurement.
        range_m: What is so near is red and what is so far blue, m.
    """
    near_m, far_m = range_m
    seen = depth > 0
    shares = (np.where(seen, depth, near_m) - near_m) / (far_m - near_m)
    return np.where(seen[..., None], _colored(shares, DEPTH_COLORS), np.array(NO_DEPTH, np.uint8))


def error_picture(rgb: Picture, expected: Picture, most: float) -> Picture:
    """How far the colours of two pictures are apart.

    Args:
        rgb: Of the same size as the other.
        expected: The other.
        most: Mean absolute difference of the channels that is shown brightest, of at most 1.
    """
    apart = np.abs(rgb.astype(np.float32) - expected.astype(np.float32)).mean(axis=2)
    return _colored(apart / (255 * most), ERROR_COLORS)


def write_on(
    picture: Picture, text: str, place: tuple[int, int], color: tuple[int, int, int]
) -> None:
    """Writes a line into a picture, in a dark outline.

    Args:
        picture: Is changed.
        text: Of ASCII characters.
        place: Column and row of its lower left corner, px; it is moved where it would not fit.
        color: RGB.
    """
    import cv2

    (width, _), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, 0.4, 3)
    place = (max(0, min(place[0], picture.shape[1] - width)), place[1])
    for ink, thickness in (((0, 0, 0), 3), (color, 1)):
        cv2.putText(
            picture, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.4, ink, thickness, cv2.LINE_AA
        )


def corners_of(box: NDArray[np.floating]) -> NDArray[np.float64]:
    """[8,3] corners of a box [2,3] along the axes; ends of an edge differ in one bit of the row."""
    rows = (np.arange(8)[:, None] >> np.arange(3)) & 1
    return np.asarray(box[rows, np.arange(3)], np.float64)


def draw_box(
    picture: Picture,
    corners: NDArray[np.floating],
    camera: Camera,
    color: tuple[int, int, int],
    scale: int = 1,
) -> None:
    """Draws the edges of a box, unless it reaches behind the camera.

    Args:
        picture: Is changed.
        corners: [8,3] in the world, m, in the order of `corners_of`.
        camera: Of the picture.
        color: RGB.
        scale: Pixels of the picture for one of the camera.
    """
    import cv2

    pose = camera.world_from_camera
    x, y, z = ((corners - pose[:3, 3]) @ pose[:3, :3]).T
    if (z < NEAREST_M).any():
        return
    places = np.stack([camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy], axis=1)
    ends = (scale * places).round().clip(-9999, 9999).astype(int).tolist()
    for one in range(8):
        for other in (one | 1, one | 2, one | 4):
            if other != one:
                cv2.line(picture, ends[one], ends[other], color, 1, cv2.LINE_AA)


def legend(colors: str, width: int = 256, height: int = 12) -> Picture:
    """A strip of all colours of a colour map, from its start at the left."""
    shares = (np.arange(width) + 0.5) / width
    return _colored(np.tile(shares, (height, 1)), colors)


def heat_picture(rgb: Picture, shares: NDArray[np.floating]) -> Picture:
    """A picture in grey, in which heat has colours.

    Args:
        rgb: Of the same size as the heat.
        shares: [H,W] heat, 0 to 1.
    """
    grey = np.repeat(rgb.mean(axis=2, keepdims=True), 3, axis=2)
    weights = shares.clip(0, 1)[..., None]
    mixed = (1 - weights) * grey + weights * _colored(shares, HEAT_COLORS)
    result: Picture = np.rint(mixed).astype(np.uint8)
    return result


def _colored(shares: NDArray[np.floating], colors: str) -> Picture:
    from matplotlib import colormaps  # It takes half a second to import.

    picture: Picture = colormaps[colors](shares.clip(0, 1), bytes=True)[..., :3]
    return picture
