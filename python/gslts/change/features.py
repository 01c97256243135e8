"""Dense image features that are robust to lighting, for the feature mask of GS-LTS (M_feat)."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

import cv2
import numpy as np

from gslts.change.constants import (
    GRADIENT_FLOOR,
    MIN_DEVIATION,
    ORIENTATIONS,
    PEAK_STEP_SHARE,
    PEAK_STEPS,
    POOLING_SIGMAS,
)
from gslts.types import Floats32


class FeatureExtractor(Protocol):
    """Computes dense features of an image."""

    def __call__(self, rgb: Floats32) -> Floats32:
        """Compute features of any length.

        Args:
            rgb: [H,W,3] sRGB, 0 to 1.

        Returns:
            [h,w,D] feature of each cell of a grid over the image.
        """
        ...


class OrientedGradients:
    """Computes gradient magnitudes by orientation, pooled over two neighbourhoods.

    These are the histograms of DAISY (Tola et al. 2010) without its ring of positions. One more,
    constant feature makes plain surfaces similar.

    Args:
        halvings: Number of times the sides of the image are halved first.
    """

    def __init__(self, halvings: int = 1) -> None:
        self._divisor = 2**halvings

    def __call__(self, rgb: Floats32) -> Floats32:
        """Compute [h,w,17] features; see `FeatureExtractor`.

        Args:
            rgb: [H,W,3] sRGB, 0 to 1.
        """
        gray = cv2.cvtColor(np.ascontiguousarray(rgb), cv2.COLOR_RGB2GRAY)
        height, width = (max(1, length // self._divisor) for length in gray.shape)
        gray = cv2.resize(gray, (width, height), interpolation=cv2.INTER_AREA)
        across = cv2.Sobel(gray, cv2.CV_32F, 1, 0, ksize=3, scale=1 / 8)
        down = cv2.Sobel(gray, cv2.CV_32F, 0, 1, ksize=3, scale=1 / 8)
        angles = 2 * np.pi / ORIENTATIONS * np.arange(ORIENTATIONS)
        edges = np.stack(
            [np.maximum(0, np.cos(a) * across + np.sin(a) * down) for a in angles], axis=-1
        ).astype(np.float32)
        # OpenCV filters take four channels at once.
        pooled = [
            cv2.GaussianBlur(np.ascontiguousarray(edges[..., k : k + 4]), (0, 0), share * width)
            for share in POOLING_SIGMAS
            for k in range(0, ORIENTATIONS, 4)
        ]
        floor = np.full((*gray.shape, 1), GRADIENT_FLOOR, np.float32)
        return np.concatenate([*pooled, floor], axis=-1)


def similarity(first: Floats32, second: Floats32, height: int, width: int) -> Floats32:
    """Compute the cosine of two feature images at the resolution of the image.

    Args:
        first: [h,w,D] features.
        second: [h,w,D] features.
        height: Height of the result, px.
        width: Width of the result, px.

    Returns:
        [height,width] cosine, -1 to 1.
    """
    products = np.einsum("hwd,hwd->hw", first, second)
    squares = [np.einsum("hwd,hwd->hw", features, features) for features in (first, second)]
    lengths = np.sqrt(squares[0] * squares[1])
    cosines: Floats32 = (products / np.maximum(lengths, 1e-12)).astype(np.float32)
    if cosines.shape == (height, width):
        return cosines
    resized = cv2.resize(cosines, (width, height), interpolation=cv2.INTER_LINEAR)
    return np.asarray(resized, np.float32)


def alignment_peak(first: Floats32, second: Floats32) -> float:
    """Compute how much better two feature images agree as they are than displaced.

    This is the ratio of peak and sidelobes of a correlation (Bolme et al. 2010), of mean cosines:
    it asks if the images show one place, whatever light and objects have changed there.

    Args:
        first: [h,w,D] features.
        second: [h,w,D] features.

    Returns:
        Mean cosine without a displacement minus its mean over displacements in all directions, in
        standard deviations of the latter; 0 if no displacement changes it, or if the images are
        too small to be displaced.
    """
    height, width = first.shape[:2]
    step = max(1, round(PEAK_STEP_SHARE * width))
    if min(height, width) <= PEAK_STEPS * step:
        return 0.0
    first, second = (
        features / np.maximum(np.linalg.norm(features, axis=-1, keepdims=True), 1e-12)
        for features in (first, second)
    )

    def agreement(right: int, down: int) -> float:
        """Return the mean cosine where the displaced images overlap."""
        rows, columns = slice(max(0, down), height + down), slice(max(0, right), width + right)
        moved_rows, moved = (
            slice(max(0, -down), height - down),
            slice(max(0, -right), width - right),
        )
        products = first[rows, columns] * second[moved_rows, moved]
        return float(products.sum(axis=-1).mean())

    offsets = [step * k for k in range(-PEAK_STEPS, PEAK_STEPS + 1)]
    displaced = [agreement(x, y) for x in offsets for y in offsets if (x, y) != (0, 0)]
    deviation = float(np.std(displaced))
    if deviation < MIN_DEVIATION:
        return 0.0
    return (agreement(0, 0) - float(np.mean(displaced))) / deviation


def feature_extractor(name: str) -> FeatureExtractor:
    """Return the feature extractor that a name stands for.

    Args:
        name: "gradients", "onnx:FILE" or "transformers:DIR".

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
