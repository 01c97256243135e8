"""Images as networks take them: normalized, with the channels first."""

from __future__ import annotations

import numpy as np

from gslts.types import Bytes, Floats32

Channels = tuple[float, float, float]
"""A number for each of red, green and blue, for colours between 0 and 1."""

IMAGENET_MEAN: Channels = (0.485, 0.456, 0.406)
"""Mean of the images of ImageNet, by which SAM and DINOv2 were trained."""
IMAGENET_STD: Channels = (0.229, 0.224, 0.225)
"""Standard deviation of the same images."""
CLIP_MEAN: Channels = (0.48145466, 0.4578275, 0.40821073)
"""Mean of the training images of CLIP."""
CLIP_STD: Channels = (0.26862954, 0.26130258, 0.27577711)
"""Standard deviation of the same images."""


def normalize(rgb: Bytes, mean: Channels, std: Channels) -> Floats32:
    """Subtract the mean of training images, and divide by their standard deviation.

    Args:
        rgb: [H,W,3] uint8, sRGB.
        mean: Of the training images.
        std: Their standard deviation.

    Returns:
        [1,3,H,W] float32, contiguous.
    """
    colors = rgb.astype(np.float32) / np.float32(255)
    normalized = (colors - np.array(mean, np.float32)) / np.array(std, np.float32)
    return np.ascontiguousarray(normalized.transpose(2, 0, 1)[None])


def resize_longest_side(rgb: Bytes, side_px: int) -> Bytes:
    """Resize an image so that its longer side fills a square, as for SAM.

    Args:
        rgb: [H,W,3] uint8, sRGB.
        side_px: Side of the square.

    Returns:
        [h,w,3] uint8.
    """
    from PIL import Image  # Its filter is that of the training images.

    height, width = rgb.shape[:2]
    scale = side_px / max(height, width)
    size = max(1, int(width * scale + 0.5)), max(1, int(height * scale + 0.5))
    return np.asarray(Image.fromarray(rgb).resize(size, Image.Resampling.BILINEAR))


def pad_to_square(pixels: Floats32, side_px: int) -> Floats32:
    """Pad an image with zeros to a square, at its right and bottom.

    Args:
        pixels: [1,3,h,w] float32.
        side_px: Side of the square.

    Returns:
        [1,3,side_px,side_px] float32.
    """
    height, width = pixels.shape[2:]
    return np.pad(pixels, ((0, 0), (0, 0), (0, side_px - height), (0, side_px - width)))
