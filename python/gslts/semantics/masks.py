"""Masks of a picture: without doubles, as labels, and as pictures of their own."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PIL import Image

Masks = NDArray[np.bool_]

SAME_IOU = 0.8
"""Masks that overlap more are one, as in LangSplat (Qin et al. 2024)."""


def suppress_duplicates(masks: Masks, scores: NDArray[np.float32]) -> NDArray[np.intp]:
    """[K'] rows of masks [K,h,w], the best first, none of which is the same as a better one."""
    order = np.argsort(-scores, kind="stable")
    flat = masks.reshape(len(masks), masks[:1].size)[order].astype(np.float32)
    areas, shared = flat.sum(axis=1), flat @ flat.T
    same = shared > SAME_IOU * (areas[:, None] + areas - shared)
    kept: list[int] = []
    for row in range(len(order)):
        if not same[row, kept].any():
            kept.append(row)
    return np.asarray(order[kept], np.intp)


def paint_labels(masks: Masks) -> NDArray[np.int32]:
    """[H,W] row of the mask [K,H,W] that each pixel takes; -1 for none.

    The smallest wins, or what stands on a table would be lost under the mask of both.
    """
    labels = np.full(masks.shape[1:], -1, np.int32)
    for row in np.argsort(-masks.sum(axis=(1, 2)), kind="stable"):
        labels[masks[row]] = row
    return labels


def crop_to_mask(rgb: NDArray[np.uint8], mask: Masks, side_px: int) -> NDArray[np.uint8]:
    """[side_px,side_px,3] what a mask [H,W] covers, the rest black, as LangSplat shows it to CLIP.

    It is cut to the box around the mask, which keeps its proportions, in the middle.
    """
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    box = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    part = np.where(mask[box][..., None], rgb[box], 0).astype(np.uint8)
    height, width = part.shape[:2]
    side = max(height, width)
    square = np.zeros((side, side, 3), np.uint8)
    top, left = (side - height) // 2, (side - width) // 2
    square[top : top + height, left : left + width] = part
    size = (side_px, side_px)
    return np.asarray(Image.fromarray(square).resize(size, Image.Resampling.BICUBIC))
