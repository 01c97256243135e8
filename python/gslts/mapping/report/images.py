"""Pictures inside an HTML page: as addresses that hold the data themselves."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gslts.io.images import RgbImage
from gslts.mapping.report.data import CurvePoint

WIDTH_PX, QUALITY = 320, 85
INK = "#808080"
"""Readable on white and on black."""
TRAINING, HELD_OUT, GAUSSIANS = "#3b82c4", "#d9822b", "#4c9a5b"


def smaller(picture: NDArray[Any]) -> NDArray[Any]:
    """A picture or a depth image, at most WIDTH_PX wide.

    Colours are averaged over what becomes one pixel; of depths one is taken, because the mean of
    two surfaces, or of a surface and no measurement, is a depth that nothing has.
    """
    from PIL import Image

    height, width = picture.shape[:2]
    if width <= WIDTH_PX:
        return picture
    new_height = max(1, round(height * WIDTH_PX / width))
    if picture.ndim == 3:
        image = Image.fromarray(picture).resize((WIDTH_PX, new_height), Image.Resampling.BOX)
        return np.asarray(image)
    rows = ((np.arange(new_height) + 0.5) * height / new_height).astype(int)
    columns = ((np.arange(WIDTH_PX) + 0.5) * width / WIDTH_PX).astype(int)
    return picture[np.ix_(rows, columns)]


def jpeg_of(picture: RgbImage) -> str:
    """A picture as the address of an <img>."""
    return _encoded(picture, "JPEG", quality=QUALITY, optimize=True)


def png_of(picture: RgbImage) -> str:
    """The same without loss, for what is small or plain."""
    return _encoded(picture, "PNG", optimize=True)


def psnr_svg(curve: Sequence[CurvePoint]) -> str:
    """PSNR of both kinds of frames over seconds."""
    figure, axes = _axes("s", "PSNR, dB")
    seconds = [point.seconds for point in curve]
    psnr_db = [point.training_psnr_db for point in curve]
    axes.plot(seconds, psnr_db, color=TRAINING, label="frames learned from")
    held_out = [
        (point.seconds, point.held_out_psnr_db)
        for point in curve
        if point.held_out_psnr_db is not None
    ]
    if held_out:
        times, values = zip(*held_out, strict=True)
        axes.plot(times, values, "o-", color=HELD_OUT, markersize=3, label="frames kept aside")
    axes.legend(loc="lower right", frameon=False, labelcolor=INK)
    return _svg(figure)


def size_svg(curve: Sequence[CurvePoint]) -> str:
    """Number of Gaussians over seconds."""
    figure, axes = _axes("s", "Gaussians")
    seconds = [point.seconds for point in curve]
    axes.plot(seconds, [point.gaussians for point in curve], color=GAUSSIANS)
    axes.set_ylim(bottom=0)
    return _svg(figure)


def histogram_svg(values: NDArray[np.float64], name: str) -> str:
    """How many poses were corrected by how much."""
    figure, axes = _axes(name, "poses")
    axes.hist(values, bins=30, range=(0, max(float(values.max()), 1e-3)), color=TRAINING)
    return _svg(figure)


def _axes(x: str, y: str) -> tuple[Any, Any]:
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5, 3.2), layout="constrained")
    FigureCanvasSVG(figure)
    axes = figure.subplots()
    for patch in (figure.patch, axes.patch):
        patch.set_alpha(0)
    for side in axes.spines.values():
        side.set_color(INK)
    axes.tick_params(colors=INK)
    axes.set_xlabel(x, color=INK)
    axes.set_ylabel(y, color=INK)
    axes.grid(visible=True, alpha=0.25)
    return figure, axes


def _svg(figure: Any) -> str:
    from matplotlib import rc_context

    buffer = io.BytesIO()
    with rc_context({"svg.hashsalt": "gslts"}):  # The same names in every run.
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    return _address("image/svg+xml", buffer.getvalue())


def _encoded(picture: RgbImage, kind: str, **options: Any) -> str:
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(picture).save(buffer, format=kind, **options)
    return _address(f"image/{kind.lower()}", buffer.getvalue())


def _address(kind: str, content: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(content).decode()}"
