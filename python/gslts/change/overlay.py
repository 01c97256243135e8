"""An image that shows a detection: the frame, the map and the masks side by side."""

from __future__ import annotations

import cv2
import numpy as np

from gslts.change.changes import Change
from gslts.change.detection import Detection
from gslts.core.camera import Camera
from gslts.io.images import RgbImage, box_corners, draw_box, draw_text, to_rgb8

COLORS = {
    "addition": (40, 200, 70),
    "removal": (230, 60, 50),
    "relocation": (60, 120, 250),
    "shift": (250, 170, 30),
}
"""RGB, 0 to 255, of each kind of change."""
MIN_WIDTH_PX = 480
"""Minimum width of each panel; its text, of a fixed size, would not fit on half of it."""
MASK_OPACITY = 0.55
"""Opacity of the mask colour over the image, so that the object stays visible."""


def overlay(detection: Detection) -> RgbImage:
    """Draw the frame with additions, the map with removals, and the masks, side by side.

    Args:
        detection: Result of the detector; its images are enlarged by an integer.

    Returns:
        [H,3W,3] uint8 sRGB.
    """
    scale = -(-MIN_WIDTH_PX // detection.observed_rgb.shape[1])
    observed = _enlarge(to_rgb8(detection.observed_rgb), scale)
    if detection.rendered_rgb is None:
        blank = np.full_like(observed, 60)
        draw_text(observed, f"unreliable: {detection.unreliable}", (8, 20), (255, 210, 60))
        return np.concatenate([observed, blank, blank], axis=1)
    rendered = _enlarge(to_rgb8(detection.rendered_rgb), scale)
    for change in detection.changes:
        for image, side in ((rendered, 0), (observed, 1)):
            _draw(image, change, side, detection.camera)
    if not detection.changes:
        draw_text(observed, "no change", (8, 20), (255, 255, 255))
    return np.concatenate([observed, rendered, _enlarge(_masks(detection), scale)], axis=1)


def _enlarge(image: RgbImage, scale: int) -> RgbImage:
    return image.repeat(scale, axis=0).repeat(scale, axis=1)


def _masks(detection: Detection) -> RgbImage:
    """Draw M_pixel in red, M_feat in blue and M_comb in white."""
    image = np.zeros(detection.observed_rgb.shape, np.uint8)
    assert detection.pixel_mask is not None  # As there is a rendering.
    assert detection.feature_mask is not None
    assert detection.combined_mask is not None
    image[detection.pixel_mask, 0] = 170
    image[detection.feature_mask, 2] = 170
    image[detection.combined_mask] = 255
    return image


def _draw(image: RgbImage, change: Change, side: int, camera: Camera) -> None:
    """Draw the mask, the box and the label of a change; side 0 is before, 1 after."""
    color, mask, box = COLORS[change.kind], change.masks[side], change.boxes[side]
    if mask is None:
        return
    scale = image.shape[1] // mask.shape[1]
    mask = mask.repeat(scale, axis=0).repeat(scale, axis=1)
    mixed = (1 - MASK_OPACITY) * image[mask] + MASK_OPACITY * np.array(color)
    image[mask] = mixed.astype(np.uint8)
    outlines, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(image, outlines, -1, color, 1)
    if box is not None:
        draw_box(image, box_corners(np.array(box)), camera, color, scale)
    rows, columns = np.nonzero(mask)
    position = (max(0, int(columns.min())), max(12, int(rows.min()) - 4))
    draw_text(image, f"{change.kind} {change.confidence:.2f}", position, color)
