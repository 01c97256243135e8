"""A picture of what was detected."""

from __future__ import annotations

import cv2
import numpy as np

from gslts.change.changes import Change
from gslts.change.detector import Detection
from gslts.core.camera import Camera
from gslts.io.images import RgbImage, box_corners, draw_box, draw_text, to_rgb8

COLORS = {"addition": (40, 200, 70), "removal": (230, 60, 50), "relocation": (60, 120, 250)}
"""RGB of each kind."""
LEAST_WIDTH_PX = 480
"""Of each picture, so that words can be read."""
MIDDLE = 0.55
"""Share of the colour in what a mask covers."""


def overlay(detection: Detection) -> RgbImage:
    """The photograph with what appeared, the map with what vanished, and the masks, side by side.

    Each is a whole number of times as large as the images that were compared.
    """
    scale = -(-LEAST_WIDTH_PX // detection.photo.shape[1])
    photo = _enlarged(to_rgb8(detection.photo), scale)
    if detection.render is None:
        blank = np.full_like(photo, 60)
        draw_text(photo, f"unreliable: {detection.unreliable}", (8, 20), (255, 210, 60))
        return np.concatenate([photo, blank, blank], axis=1)
    render, masks = (
        _enlarged(one, scale) for one in (to_rgb8(detection.render), _masks(detection))
    )
    for change in detection.changes:
        for picture, side in ((render, 0), (photo, 1)):
            _draw(picture, change, side, detection.camera)
    if not detection.changes:
        draw_text(photo, "no change", (8, 20), (255, 255, 255))
    return np.concatenate([photo, render, masks], axis=1)


def _enlarged(picture: RgbImage, scale: int) -> RgbImage:
    return picture.repeat(scale, axis=0).repeat(scale, axis=1)


def _masks(detection: Detection) -> RgbImage:
    """M_pixel in red, M_feat in blue and M_comb in white."""
    picture = np.zeros(detection.photo.shape, np.uint8)
    assert detection.pixel is not None  # As there is a render.
    assert detection.feature is not None
    assert detection.combined is not None
    picture[detection.pixel, 0] = 170
    picture[detection.feature, 2] = 170
    picture[detection.combined] = 255
    return picture


def _draw(picture: RgbImage, change: Change, side: int, camera: Camera) -> None:
    color, mask, box = COLORS[change.kind], change.masks[side], change.boxes[side]
    if mask is None:
        return
    scale = picture.shape[1] // mask.shape[1]
    mask = mask.repeat(scale, axis=0).repeat(scale, axis=1)
    mixed = (1 - MIDDLE) * picture[mask] + MIDDLE * np.array(color)
    picture[mask] = mixed.astype(np.uint8)
    outlines, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(picture, outlines, -1, color, 1)
    if box is not None:
        draw_box(picture, box_corners(np.array(box)), camera, color, scale)
    rows, columns = np.nonzero(mask)
    place = (max(0, int(columns.min())), max(12, int(rows.min()) - 4))
    draw_text(picture, f"{change.kind} {change.confidence:.2f}", place, color)
