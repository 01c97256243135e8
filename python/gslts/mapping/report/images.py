"""Small images, and plots as data URLs, of the report."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from gslts.io.data_urls import data_url
from gslts.io.image_files import shrink_image
from gslts.mapping.report.data import CurvePoint
from gslts.mapping.report.plot import Curve, plot_svg
from gslts.types import Floats

WIDTH_PX = 320
"""Maximum width of images on the page, px."""
TRAINING, VALIDATION, GAUSSIANS = "#3b82c4", "#d9822b", "#4c9a5b"
"""Colours of the curves."""


def shrink(image: Any) -> Any:
    """Shrink a colour or depth image to at most WIDTH_PX.

    Colours are averaged; of depths the nearest is taken, as the mean of two surfaces, or of a
    surface and no measurement, is a depth that nothing has.

    Args:
        image: [H,W,3] uint8 or [H,W] depth.

    Returns:
        [h,w,3] or [h,w] of the same dtype.
    """
    height, width = image.shape[:2]
    if width <= WIDTH_PX:
        return image
    if image.ndim == 3:
        return shrink_image(image, (WIDTH_PX, height))
    new_height = max(1, round(height * WIDTH_PX / width))
    rows = ((np.arange(new_height) + 0.5) * height / new_height).astype(int)
    columns = ((np.arange(WIDTH_PX) + 0.5) * width / WIDTH_PX).astype(int)
    return image[np.ix_(rows, columns)]


def psnr_svg(curve: Sequence[CurvePoint]) -> str:
    """Plot the PSNR of training and validation frames over time; return a data URL.

    Args:
        curve: Course of the optimization.
    """
    seconds = [point.seconds for point in curve]
    psnr_db = [point.training_psnr_db for point in curve]
    curves = [Curve(seconds, psnr_db, TRAINING, "training frames")]
    validation = [
        (point.seconds, point.validation_psnr_db)
        for point in curve
        if point.validation_psnr_db is not None
    ]
    if validation:
        times, values = zip(*validation, strict=True)
        curves.append(Curve(times, values, VALIDATION, "validation frames", dots=True))
    return _svg(plot_svg("s", "PSNR, dB", curves))


def size_svg(curve: Sequence[CurvePoint]) -> str:
    """Plot the number of Gaussians over time; return a data URL.

    Args:
        curve: Course of the optimization.
    """
    seconds = [point.seconds for point in curve]
    sizes = Curve(seconds, [point.gaussians for point in curve], GAUSSIANS)
    return _svg(plot_svg("s", "Gaussians", [sizes], from_zero=True))


def histogram_svg(values: Floats, name: str) -> str:
    """Plot the histogram of the corrections of poses; return a data URL.

    Args:
        values: [F] sizes of the corrections.
        name: Label of the axis, with the unit.
    """
    counts, edges = np.histogram(values, bins=30, range=(0, max(float(values.max()), 1e-3)))
    bars = Curve(edges.repeat(2)[1:-1].tolist(), counts.repeat(2).tolist(), TRAINING, filled=True)
    return _svg(plot_svg(name, "poses", [bars], from_zero=True))


def _svg(text: str) -> str:
    return data_url("image/svg+xml", text.encode())
