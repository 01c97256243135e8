"""Masks of an image: removal of duplicates, label images, and crops."""

from __future__ import annotations

import numpy as np

from gslts.types import Bools, Bytes, Floats32, Indices, Ints32

PixelBox = tuple[int, int, int, int]
"""Columns [x0, x1) and rows [y0, y1) of a box in an image, as (x0, y0, x1, y1)."""

MAX_IOU = 0.8
"""Masks with a larger intersection over union are duplicates; the value of LangSplat."""


def suppress_duplicates(masks: Bools, scores: Floats32) -> Indices:
    """Suppress masks that overlap a better one (non-maximum suppression).

    Args:
        masks: [K,H,W] bool.
        scores: [K] float32, higher is better.

    Returns:
        Rows of the masks to keep, the best first.
    """
    order = np.argsort(-scores, kind="stable")
    flat = masks.reshape(len(masks), masks[:1].size)[order].astype(np.float32)
    areas, shared = flat.sum(axis=1), flat @ flat.T
    is_duplicate = shared > MAX_IOU * (areas[:, None] + areas - shared)
    kept: list[int] = []
    for row in range(len(order)):
        if not is_duplicate[row, kept].any():
            kept.append(row)
    return np.asarray(order[kept], np.intp)


def paint_labels(masks: Bools) -> Ints32:
    """Paint masks into a label image, the smallest on top.

    In the other order, an object on a table would be hidden by a mask of both.

    Args:
        masks: [K,H,W] bool.

    Returns:
        [H,W] int32, row of the mask at each pixel; -1 for none.
    """
    labels = np.full(masks.shape[1:], -1, np.int32)
    for row in np.argsort(-masks.sum(axis=(1, 2)), kind="stable"):
        labels[masks[row]] = row
    return labels


def box_of_mask(mask: Bools, width: int | None = None) -> PixelBox | None:
    """Return the bounding box of a mask.

    Args:
        mask: [H,W] bool, of an image or of a halved one.
        width: Width of the image, px; None means that of the mask.

    Returns:
        Columns [x0, x1) and rows [y0, y1) of the image, as (x0, y0, x1, y1); None if the mask is
        empty.
    """
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return None
    scale = 1 if width is None else width // mask.shape[1]
    x0, y0, x1, y1 = columns[0], rows[0], columns[-1] + 1, rows[-1] + 1
    return scale * int(x0), scale * int(y0), scale * int(x1), scale * int(y1)


def box_ious(box: PixelBox | Floats32, boxes: Floats32) -> Floats32:
    """Return the intersections over unions of a box with others.

    Args:
        box: (4,) x0, y0, x1, y1, px.
        boxes: [K,4] float32, others.

    Returns:
        [K] float32, 0 to 1.
    """
    first = np.asarray(box, np.float32)
    low, high = np.maximum(first[:2], boxes[:, :2]), np.minimum(first[2:], boxes[:, 2:])
    shared = np.prod(np.maximum(0, high - low), axis=1)
    areas = np.prod(boxes[:, 2:] - boxes[:, :2], axis=1)
    return np.asarray(shared / (areas + np.prod(first[2:] - first[:2]) - shared), np.float32)


def crop_to_mask(rgb: Bytes, mask: Bools, side_px: int) -> Bytes:
    """Crop an image to the bounding box of a mask, on black, as LangSplat does for CLIP.

    Args:
        rgb: [H,W,3] uint8, sRGB.
        mask: [H,W] bool, not empty.
        side_px: Side of the result.

    Returns:
        [side_px,side_px,3] uint8; the crop is centred and keeps its aspect ratio.
    """
    from PIL import Image  # Its filter is that of the training images.

    found = box_of_mask(mask)
    assert found is not None
    x0, y0, x1, y1 = found
    box = slice(y0, y1), slice(x0, x1)
    crop = np.where(mask[box][..., None], rgb[box], 0).astype(np.uint8)
    height, width = crop.shape[:2]
    side = max(height, width)
    square = np.zeros((side, side, 3), np.uint8)
    top, left = (side - height) // 2, (side - width) // 2
    square[top : top + height, left : left + width] = crop
    size = (side_px, side_px)
    return np.asarray(Image.fromarray(square).resize(size, Image.Resampling.BICUBIC))
