"""What an image shows besides its colours: dense features that lighting does not change."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

import cv2
import numpy as np

from gslts.types import Floats32

ORIENTATIONS = 8
POOLED_SHARES = (0.006, 0.02)
"""Standard deviations of the neighbourhoods, of the width of the image."""
NOISE = 0.02
"""Of the brightness, 0 to 1, from pixel to pixel: fainter edges are none."""


class FeatureExtractor(Protocol):
    """Computes dense features."""

    def __call__(self, rgb: Floats32) -> Floats32:
        """Of any length.

        Args:
            rgb: [H,W,3] sRGB, 0 to 1.

        Returns:
            [h,w,D], one for each part of the image, which may be larger than a pixel.
        """
        ...


class OrientedGradients:
    """How strong the edges around each pixel are, by orientation, in small and larger surroundings.

    These are the histograms of which DAISY (Tola et al. 2010) is made, without its ring of
    places. One more feature, always the same, makes plain surfaces alike.

    Args:
        halvings: How often the sides of the image are halved first.
    """

    def __init__(self, halvings: int = 1) -> None:
        self._scale = 2**halvings

    def __call__(self, rgb: Floats32) -> Floats32:
        """[h,w,17]; see `FeatureExtractor`."""
        grey = cv2.cvtColor(np.ascontiguousarray(rgb), cv2.COLOR_RGB2GRAY)
        height, width = (max(1, length // self._scale) for length in grey.shape)
        grey = cv2.resize(grey, (width, height), interpolation=cv2.INTER_AREA)
        across = cv2.Sobel(grey, cv2.CV_32F, 1, 0, ksize=3, scale=1 / 8)
        down = cv2.Sobel(grey, cv2.CV_32F, 0, 1, ksize=3, scale=1 / 8)
        angles = 2 * np.pi / ORIENTATIONS * np.arange(ORIENTATIONS)
        edges = np.stack(
            [np.maximum(0, np.cos(a) * across + np.sin(a) * down) for a in angles], axis=-1
        ).astype(np.float32)
        sigmas = [share * width for share in POOLED_SHARES]
        # Filters take four channels at once.
        pooled = [
            cv2.GaussianBlur(np.ascontiguousarray(edges[..., k : k + 4]), (0, 0), sigma)
            for sigma in sigmas
            for k in range(0, ORIENTATIONS, 4)
        ]
        floor = np.full((*grey.shape, 1), NOISE, np.float32)
        return np.concatenate([*pooled, floor], axis=-1)


def similarity(one: Floats32, other: Floats32, height: int, width: int) -> Floats32:
    """[H,W] cosine of two feature images [h,w,D], -1 to 1."""
    products = np.einsum("hwd,hwd->hw", one, other)
    lengths = np.sqrt(np.einsum("hwd,hwd->hw", one, one) * np.einsum("hwd,hwd->hw", other, other))
    cosines: Floats32 = (products / np.maximum(lengths, 1e-12)).astype(np.float32)
    if cosines.shape == (height, width):
        return cosines
    resized = cv2.resize(cosines, (width, height), interpolation=cv2.INTER_LINEAR)
    return np.asarray(resized, np.float32)


def extractor_of(name: str) -> FeatureExtractor:
    """The extractor "gradients", "onnx:FILE" or "transformers:DIR".

    Raises:
        ValueError: There is no such extractor, or its model does not fit.
        OSError: Its model cannot be read.
        ImportError: A package is missing.
    """
    kind, _, path = name.partition(":")
    if name == "gradients":
        return OrientedGradients()
    if kind == "onnx" and path:
        from gslts.change.onnx_features import OnnxEncoder

        return OnnxEncoder(Path(path))
    if kind == "transformers" and path:
        from gslts.change.transformers_features import TransformersEncoder

        return TransformersEncoder(Path(path))
    raise ValueError(f"features: expected gradients, onnx:FILE or transformers:DIR, got {name!r}")
