"""Detectors and instance segmentation networks from ONNX or Darknet files, on the CPU."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from gslts.io.onnx_file import MAX_SIDE_PX, check_size, first_line, image_input, open_onnx
from gslts.semantics.detector_layouts import (
    DARKNET,
    LAYOUTS,
    Candidates,
    Layout,
    Size,
    recognize_layout,
)
from gslts.types import Bools, Bytes, Floats32, Indices

DEFAULT_SIDE_PX = 640
"""Side of the input image where the model leaves it open, px: that of the YOLOs."""
GREY = 114
"""Colour of the rest of the input beside the image, that of the YOLOs."""
MIN_SCORE = 0.15
"""Minimum score of a detection. Lower ones are mostly wrong, and at double, small objects are seen
in too few views."""
MAX_IOU = 0.45
"""Boxes of a class with a larger intersection over union are one detection, as in YOLOv5."""
MAX_DETECTIONS = 60
"""Maximum number of detections of an image, the best; bounds time."""
MAX_CFG_BYTES = 1 << 20
"""Maximum size of a `.cfg` of Darknet; those of published networks have 1 to 50 KB."""

Network = Callable[[Floats32], list[Floats32]]
"""Computes the outputs for an input [1,3,H,W] float32."""


@dataclass(frozen=True, eq=False)
class Detections:
    """Objects that a detector found in an image.

    Attributes:
        boxes: [K,4] float32 left, top, right, bottom, px, within the image.
        scores: [K] float32, 0 to 1, the best first.
        classes: [K] number of the class.
        masks: [K,H,W] bool; None if the network has none.
    """

    boxes: Floats32
    scores: Floats32
    classes: Indices
    masks: Bools | None = None


class Detector:
    """Detector from a file, with one thread, so that results are repeatable.

    Args:
        path: ONNX file, or `.weights` of Darknet with its `.cfg` beside it.
        classes: Number of its classes.
        layout: Key of `LAYOUTS`; None recognizes it by the outputs.

    Attributes:
        layout: Key of `LAYOUTS`.

    Raises:
        ImportError: onnxruntime is missing.
        OSError: A file is missing.
        ValueError: A file is damaged, or no detector of so many classes.
    """

    def __init__(self, path: Path, classes: int, layout: str | None = None) -> None:
        self._path = path
        if path.suffix == ".weights":
            self._network, self._size = _open_darknet(path)
            layout = layout or DARKNET
        else:
            self._network, self._size = _open_onnx(path)
        width, height = self._size
        shapes = [output.shape for output in self._run(np.zeros((1, 3, height, width), np.float32))]
        try:
            self.layout = recognize_layout(shapes, self._size, classes, layout)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None

    def __call__(self, rgb: Bytes) -> Detections:
        """Detect the objects of an image.

        Args:
            rgb: [H,W,3] uint8, sRGB.

        Raises:
            ValueError: The network fails, or its outputs are no detections.
        """
        layout = LAYOUTS[self.layout]
        pixels, scale, offset = _prepare(rgb, self._size, layout)
        found = layout.decode(self._run(pixels), self._size)
        best = found.scores.max(axis=1, initial=0)
        if not (np.isfinite(found.boxes).all() and np.isfinite(best).all()):
            raise ValueError(f"{self._path}: its outputs are not finite")
        if len(best) and not (found.scores.min() > -0.01 and best.max() < 1.01):
            raise ValueError(
                f"{self._path}: scores of {found.scores.min():.2f} to {best.max():.2f} are not of "
                f"the layout {self.layout}; give another one with --layout"
            )
        height, width = rgb.shape[:2]
        limits = np.array([width, height, width, height], np.float32)
        boxes = np.asarray((found.boxes - np.tile(offset, 2)) / np.tile(scale, 2), np.float32)
        boxes = boxes.clip(0, limits)
        classes = found.scores.argmax(axis=1)
        kept = _suppress(boxes, best, classes)
        masks = None
        if len(found.prototypes):
            masks = _masks(found, kept, boxes[kept], self._size, scale, offset, (width, height))
        return Detections(boxes[kept], best[kept].clip(0, 1), classes[kept], masks)

    def _run(self, pixels: Floats32) -> list[Floats32]:
        try:
            return self._network(pixels)
        except Exception as error:  # Neither library has a public base class for its errors.
            raise ValueError(f"{self._path}: it cannot be run: {first_line(error)}") from None


def _open_onnx(path: Path) -> tuple[Network, Size]:
    session = open_onnx(path)
    name, size = image_input(session, path, DEFAULT_SIDE_PX)
    return lambda pixels: session.run(None, {name: pixels}), size


def _open_darknet(path: Path) -> tuple[Network, Size]:
    check_size(path)
    cfg = path.with_suffix(".cfg")
    if not cfg.is_file():
        raise FileNotFoundError(f"{cfg}: it is missing; the weights of Darknet need it beside them")
    if cfg.stat().st_size > MAX_CFG_BYTES:
        raise ValueError(f"{cfg}: it is larger than {MAX_CFG_BYTES >> 20} MiB")
    text = cfg.read_text(encoding="utf-8", errors="replace")
    width, height, channels = (
        int(found[1])
        if (found := re.search(rf"^\s*{key}\s*=\s*(\d{{1,6}})\s*$", text, re.M))
        else 0
        for key in ("width", "height", "channels")
    )
    if channels != 3 or not 0 < width <= MAX_SIDE_PX or not 0 < height <= MAX_SIDE_PX:
        raise ValueError(
            f"{cfg}: expected images of 3 channels up to {MAX_SIDE_PX} px, got {channels} of "
            f"{width}x{height}"
        )
    try:
        net: Any = cv2.dnn.readNetFromDarknet(str(cfg), str(path))
        names = net.getUnconnectedOutLayersNames()
    except cv2.error as error:
        raise ValueError(
            f"{path}: its weights do not fit {cfg.name}: {first_line(error)}"
        ) from None

    def run(pixels: Floats32) -> list[Floats32]:
        net.setInput(pixels)
        return list(net.forward(names))

    return run, (width, height)


def _prepare(rgb: Bytes, size: Size, layout: Layout) -> tuple[Floats32, Floats32, Floats32]:
    """Return the input [1,3,H,W], and scale (2,) and offset (2,), px, from image to input."""
    height, width = rgb.shape[:2]
    scale = np.array([size[0] / width, size[1] / height], np.float32)
    offset = np.zeros(2, np.float32)
    inner = size
    if layout.fit != "stretch":
        scale[:] = scale.min()
        inner = (round(width * float(scale[0])), round(height * float(scale[1])))
        if layout.fit == "center":
            offset[:] = [(size[0] - inner[0]) // 2, (size[1] - inner[1]) // 2]
    shrinks = layout.fit == "stretch" and inner[0] < width
    how = cv2.INTER_AREA if shrinks and layout.is_bgr else cv2.INTER_LINEAR
    image = np.full((size[1], size[0], 3), GREY, np.float32)
    left, top = offset.astype(int)
    image[top : top + inner[1], left : left + inner[0]] = cv2.resize(rgb, inner, interpolation=how)
    if layout.is_bgr:
        image = image[..., ::-1]
    mean, std = (np.array(values, np.float32) for values in (layout.mean, layout.std))
    pixels = np.ascontiguousarray(((image - mean) / std).transpose(2, 0, 1)[None])
    return pixels, scale, offset


def _suppress(boxes: Floats32, scores: Floats32, classes: Indices) -> Indices:
    """Return the rows of the best detections, the best first."""
    sides = boxes[:, 2:] - boxes[:, :2]
    rows = np.flatnonzero((scores >= MIN_SCORE) & (sides >= 1).all(axis=1))
    if len(rows) == 0:
        return rows
    rectangles = np.concatenate([boxes[rows, :2], sides[rows]], axis=1)
    kept = cv2.dnn.NMSBoxesBatched(
        rectangles.tolist(), scores[rows].tolist(), classes[rows].tolist(), MIN_SCORE, MAX_IOU
    )
    best: Indices = rows[np.asarray(kept, np.intp)]
    return best[np.argsort(-scores[best], kind="stable")][:MAX_DETECTIONS]


def _masks(
    found: Candidates,
    kept: Indices,
    boxes: Floats32,
    size: Size,
    scale: Floats32,
    offset: Floats32,
    image_size: Size,
) -> Bools:
    """Return the masks [K,H,W] of detections, from the prototypes, within the boxes."""
    count, rows, columns = found.prototypes.shape
    logits = found.coefficients[kept] @ found.prototypes.reshape(count, -1)
    # From pixels of the image, through those of the input, to those of the prototypes.
    share = np.array([columns / size[0], rows / size[1]])
    matrix = np.zeros((2, 3))
    matrix[[0, 1], [0, 1]] = scale * share
    matrix[:, 2] = (0.5 * scale + offset) * share - 0.5
    masks = np.zeros((len(kept), image_size[1], image_size[0]), np.bool_)
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    for mask, logit, (left, top, right, bottom) in zip(
        masks, logits, boxes.round().astype(int), strict=True
    ):
        warped = cv2.warpAffine(logit.reshape(rows, columns), matrix, image_size, flags=flags)
        inside = slice(top, bottom), slice(left, right)
        mask[inside] = warped[inside] > 0
    return masks
