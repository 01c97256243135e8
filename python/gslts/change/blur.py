"""Blur: a frame, or a part of it behind a smeared window, without the detail that the map shows."""

from __future__ import annotations

import cv2
import numpy as np

from gslts.change.constants import (
    BLUR_SIGMA_SHARE,
    BLUR_WINDOW_SHARE,
    MIN_BLUR_AGREEMENT,
    MIN_BLURRED_SHARE,
    MIN_DETAIL,
    MIN_SHARPNESS_RATIO,
)
from gslts.types import Bools, Floats32

TINY = np.float32(1e-12)
"""Minimum of a divisor: where it is 0, so is what it divides."""


class Detail:
    """Second differences of a frame and of the rendering of the map, along rows and columns.

    Args:
        observed_rgb: [H,W,3] sRGB of the frame, 0 to 1.
        rendered_rgb: [H,W,3] sRGB of the map, 0 to 1.
        known: [H,W] pixels that the map covers.
    """

    def __init__(self, observed_rgb: Floats32, rendered_rgb: Floats32, known: Bools) -> None:
        self._grays = _gray(observed_rgb), _gray(rendered_rgb)
        self._known = known
        observed, rendered = map(_second_differences, self._grays)
        self._pairs = tuple(zip(observed, rendered, strict=True))

    def is_blurred(self) -> bool:
        """Test if the frame as a whole lacks the detail of the map, along rows or columns.

        At least one pixel must be known.
        """
        known = self._known
        return any(
            observed[known].var() < MIN_SHARPNESS_RATIO * rendered[known].var()
            for observed, rendered in self._pairs
        )

    def blurred_pixels(self) -> Bools:
        """Find the parts of the frame that show the map blurred.

        A removed object takes detail away as well, but what is seen in its place is not the
        blurred rendering.

        Returns:
            [H,W] True where the frame is blurred; nowhere if that is little of what has detail.
        """
        known = self._known
        window = _Window(known, max(3, round(BLUR_WINDOW_SHARE * known.shape[1])))
        blurred, detailed = np.zeros_like(known), np.zeros_like(known)
        for observed, rendered in self._pairs:
            detail = window.mean(rendered**2)
            has_detail = known & (detail > MIN_DETAIL**2)
            detailed |= has_detail
            blurred |= has_detail & (window.mean(observed**2) < MIN_SHARPNESS_RATIO * detail)
        if blurred.any():
            sigma_px = BLUR_SIGMA_SHARE * known.shape[1]
            smooth, other = (
                np.asarray(cv2.GaussianBlur(gray, (0, 0), sigma_px), np.float32)
                for gray in self._grays
            )
            blurred &= window.agreement(smooth, other) > MIN_BLUR_AGREEMENT
        if blurred.sum() <= MIN_BLURRED_SHARE * detailed.sum():
            return np.zeros_like(known)
        return cv2.dilate(blurred.astype(np.uint8), window.square).astype(np.bool_)


class _Window:
    """Means of images around each pixel, of known pixels only.

    Args:
        known: [H,W].
        side_px: Side of the square around a pixel, px.
    """

    def __init__(self, known: Bools, side_px: int) -> None:
        self.square = np.ones((side_px, side_px), np.uint8)
        self._weights = known.astype(np.float32)
        self._sums = np.maximum(self._box(self._weights), TINY)

    def mean(self, image: Floats32) -> Floats32:
        return np.asarray(self._box(self._weights * image) / self._sums, np.float32)

    def agreement(self, image: Floats32, other: Floats32) -> Floats32:
        """Compute the covariance as a share of the larger variance; 1 for equal images."""
        mean, other_mean = self.mean(image), self.mean(other)
        covariance = self.mean(image * other) - mean * other_mean
        variances = self.mean(image**2) - mean**2, self.mean(other**2) - other_mean**2
        larger = np.maximum(np.maximum(*variances), TINY)
        return np.asarray(covariance / larger, np.float32)

    def _box(self, image: Floats32) -> Floats32:
        return np.asarray(cv2.boxFilter(image, -1, self.square.shape), np.float32)


def _second_differences(gray: Floats32) -> tuple[Floats32, Floats32]:
    """Return [H,W] second differences of the brightness [H,W] along rows and along columns."""
    row = np.array([[1, -2, 1]], np.float32)
    along_rows, along_columns = (cv2.filter2D(gray, -1, kernel) for kernel in (row, row.T))
    return np.asarray(along_rows, np.float32), np.asarray(along_columns, np.float32)


def _gray(rgb: Floats32) -> Floats32:
    return np.asarray(cv2.cvtColor(np.ascontiguousarray(rgb), cv2.COLOR_RGB2GRAY), np.float32)
