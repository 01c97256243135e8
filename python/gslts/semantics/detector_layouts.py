"""Layouts of the outputs of detectors: recognized by their shapes, and decoded to boxes and scores.

Sources: the reference post-processing of YOLOv5 and YOLOv8 (Ultralytics), YOLOX (Ge et al. 2021),
NanoDet and NanoDet-Plus (RangiLyu), FastestDet (dog-qiuqiu) and Darknet (Redmon & Farhadi 2018).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from gslts.types import Floats32

STRIDES = (8, 16, 32, 64)
"""Sizes of the cells of a detector's grids, px; all layouts have the first three."""
ANCHORS = 3
"""Boxes per cell of YOLOv5."""
DISTANCE_BINS = 8
"""Bins of a distribution over distances from a cell to a side of its box: reg_max + 1 of
NanoDet."""

DARKNET = "darknet"
"""Key of the layout of all networks of Darknet, as OpenCV gives their outputs."""

Shape = tuple[int, ...]
Size = tuple[int, int]
"""Width and height of the input of a network, px."""


@dataclass(frozen=True, eq=False)
class Candidates:
    """Boxes of a network before suppression of overlaps.

    Attributes:
        boxes: [N,4] float32, left, top, right, bottom, px of the input of the network.
        scores: [N,K] float32 score of each class, 0 to 1.
        coefficients: [N,M] float32, weights of the prototype masks; M = 0 without masks.
        prototypes: [M,h,w] float32 prototype masks of the whole input (YOLACT, Bolya et al. 2019).
    """

    boxes: Floats32
    scores: Floats32
    coefficients: Floats32
    prototypes: Floats32


@dataclass(frozen=True)
class Layout:
    """Input and output conventions of a family of detectors.

    Attributes:
        classes: Returns the number of classes that shapes of outputs and size of the input imply;
            None if the outputs are not of this layout.
        decode: Converts outputs to `Candidates`.
        fit: Resizing to the input: "stretch", or keeping the aspect ratio with the image in the
            "center" or "corner" of a grey rest.
        is_bgr: Whether channels are in the order blue, green, red.
        mean, std: Normalization of the channels in their order, 0 to 255.
    """

    classes: Callable[[Sequence[Shape], Size], int | None]
    decode: Callable[[Sequence[Floats32], Size], Candidates]
    fit: str = "center"
    is_bgr: bool = False
    mean: tuple[float, float, float] = (0, 0, 0)
    std: tuple[float, float, float] = (255, 255, 255)


def recognize_layout(shapes: Sequence[Shape], size: Size, classes: int, forced: str | None) -> str:
    """Find the layout of the outputs of a network.

    Args:
        shapes: Of its outputs.
        size: Width and height of its input, px.
        classes: Number of names.
        forced: Key of the layout, if known; `DARKNET` is never guessed.

    Returns:
        A key of `LAYOUTS`.

    Raises:
        ValueError: No layout fits, or none with this number of classes.
    """
    if forced is not None and forced not in LAYOUTS:
        raise ValueError(f"--layout: expected one of {', '.join(LAYOUTS)}, got {forced}")
    names = [name for name in LAYOUTS if name != DARKNET] if forced is None else [forced]
    implied = {name: LAYOUTS[name].classes(shapes, size) for name in names}
    fitting = {name: count for name, count in implied.items() if count is not None and count > 0}
    for name, count in fitting.items():
        if count == classes:
            return name
    listed = ", ".join(str(list(shape)) for shape in shapes)
    if not fitting:
        kind = forced or f"any layout ({', '.join(LAYOUTS)})"
        raise ValueError(
            f"its outputs {listed} for images of {size[0]}x{size[1]} are not of {kind}"
        )
    counts = " or ".join(f"{count} ({name})" for name, count in fitting.items())
    raise ValueError(f"it has {counts} classes, but there are {classes} names")


def _cells(size: Size, levels: int) -> int:
    """Return the number of cells of all grids."""
    return sum(len(grid) for grid, _ in _grids(size, levels))


def _grids(size: Size, levels: int) -> list[tuple[Floats32, int]]:
    """Return the columns and rows [C,2] of the cells of each grid, and its stride, px."""
    grids = []
    for stride in STRIDES[:levels]:
        rows, columns = (np.arange(-(-side // stride), dtype=np.float32) for side in size[::-1])
        grids.append((np.stack(np.meshgrid(columns, rows), axis=-1).reshape(-1, 2), stride))
    return grids


def _grid_of(size: Size, cells: int) -> tuple[Floats32, Floats32]:
    """Return columns and rows [C,2] and strides [C,1] of all cells, of three or four grids."""
    levels = 3 if cells == _cells(size, 3) else 4
    grids = _grids(size, levels)
    strides = [np.full((len(grid), 1), stride, np.float32) for grid, stride in grids]
    return np.concatenate([grid for grid, _ in grids]), np.concatenate(strides)


def _main(shapes: Sequence[Shape]) -> tuple[Shape, int] | None:
    """Return the shape [A,B] of the boxes of a YOLO and its number of prototypes, if it is one."""
    flat = [shape[1:] for shape in shapes if len(shape) == 3 and shape[0] == 1]
    masks = [shape[1] for shape in shapes if len(shape) == 4 and shape[0] == 1]
    return (flat[0], sum(masks)) if len(flat) == 1 and len(masks) <= 1 else None


def _split(outputs: Sequence[Floats32]) -> tuple[Floats32, Floats32]:
    """Return the boxes [A,B] of a YOLO and its prototypes [M,h,w]."""
    boxes = next(output[0] for output in outputs if output.ndim == 3)
    masks = [output[0] for output in outputs if output.ndim == 4]
    return boxes, masks[0] if masks else np.zeros((0, 1, 1), np.float32)


def _candidates(
    centers: Floats32,
    sides: Floats32,
    scores: Floats32,
    coefficients: Floats32 | None = None,
    prototypes: Floats32 | None = None,
) -> Candidates:
    boxes = np.concatenate([centers - sides / 2, centers + sides / 2], axis=1)
    none = np.zeros((len(boxes), 0), np.float32), np.zeros((0, 1, 1), np.float32)
    return Candidates(
        boxes.astype(np.float32),
        scores.astype(np.float32),
        none[0] if coefficients is None else coefficients,
        none[1] if prototypes is None else prototypes,
    )


def _classes_yolov5(shapes: Sequence[Shape], size: Size) -> int | None:
    found = _main(shapes)
    if found is None or found[0][0] not in (ANCHORS * _cells(size, n) for n in (3, 4)):
        return None
    return found[0][1] - 5 - found[1]


def _decode_yolov5(outputs: Sequence[Floats32], size: Size) -> Candidates:  # noqa: ARG001
    rows, prototypes = _split(outputs)
    end = rows.shape[1] - len(prototypes)
    scores = rows[:, 4:5] * rows[:, 5:end]
    return _candidates(rows[:, :2], rows[:, 2:4], scores, rows[:, end:], prototypes)


def _classes_yolov8(shapes: Sequence[Shape], size: Size) -> int | None:
    found = _main(shapes)
    if found is None or found[0][1] not in (_cells(size, n) for n in (3, 4)):
        return None
    return found[0][0] - 4 - found[1]


def _decode_yolov8(outputs: Sequence[Floats32], size: Size) -> Candidates:  # noqa: ARG001
    columns, prototypes = _split(outputs)
    rows = np.ascontiguousarray(columns.T)
    end = rows.shape[1] - len(prototypes)
    return _candidates(rows[:, :2], rows[:, 2:4], rows[:, 4:end], rows[:, end:], prototypes)


def _classes_yolox(shapes: Sequence[Shape], size: Size) -> int | None:
    found = _main(shapes)
    if found is None or found[1] or found[0][0] != _cells(size, 3):
        return None
    return found[0][1] - 5


def _decode_yolox(outputs: Sequence[Floats32], size: Size) -> Candidates:
    rows, _ = _split(outputs)
    grid, strides = _grid_of(size, len(rows))
    with np.errstate(over="ignore"):  # An infinite box is rejected with all that is not finite.
        sides = np.exp(rows[:, 2:4]) * strides
    return _candidates((rows[:, :2] + grid) * strides, sides, rows[:, 4:5] * rows[:, 5:])


def _classes_nanodet(shapes: Sequence[Shape], size: Size) -> int | None:
    found = _main(shapes)
    if found is None or found[1] or found[0][0] not in (_cells(size, n) for n in (3, 4)):
        return None
    return found[0][1] - 4 * DISTANCE_BINS


def _decode_nanodet(outputs: Sequence[Floats32], size: Size) -> Candidates:
    rows, _ = _split(outputs)
    grid, strides = _grid_of(size, len(rows))
    # NanoDet, with three grids, measures from the middle of a cell, NanoDet-Plus from its corner.
    middle = 0.5 if len(rows) == _cells(size, 3) else 0.0
    logits = rows[:, -4 * DISTANCE_BINS :].reshape(-1, 4, DISTANCE_BINS)
    weights = np.exp(logits - logits.max(axis=2, keepdims=True))
    bins = np.arange(DISTANCE_BINS, dtype=np.float32)
    distances = (weights @ bins) / weights.sum(axis=2) * strides
    origin = (grid + middle) * strides
    low, high = origin - distances[:, :2], origin + distances[:, 2:]
    return _candidates((low + high) / 2, high - low, rows[:, : -4 * DISTANCE_BINS])


def _classes_fastestdet(shapes: Sequence[Shape], size: Size) -> int | None:
    cells = tuple(side // STRIDES[1] for side in size[::-1])
    if len(shapes) != 1 or len(shapes[0]) != 4 or shapes[0][2:] != cells or shapes[0][0] != 1:
        return None
    return shapes[0][1] - 5


def _decode_fastestdet(outputs: Sequence[Floats32], size: Size) -> Candidates:
    _, channels, height, width = outputs[0].shape
    rows = outputs[0][0].reshape(channels, height * width).T
    grid = np.stack(np.meshgrid(np.arange(width), np.arange(height)), axis=-1).reshape(-1, 2)
    extent = np.array(size, np.float32)
    centers = (grid + np.tanh(rows[:, 1:3])) / np.array([width, height]) * extent
    sides = extent * (0.5 + 0.5 * np.tanh(rows[:, 3:5] / 2))  # The logistic function.
    return _candidates(centers, sides, rows[:, :1] * rows[:, 5:])


def _classes_darknet(shapes: Sequence[Shape], size: Size) -> int | None:  # noqa: ARG001
    widths = {shape[1] for shape in shapes if len(shape) == 2}
    return widths.pop() - 5 if len(widths) == 1 and all(len(s) == 2 for s in shapes) else None


def _decode_darknet(outputs: Sequence[Floats32], size: Size) -> Candidates:
    rows = np.concatenate(outputs)
    extent = np.array(size, np.float32)
    return _candidates(rows[:, :2] * extent, rows[:, 2:4] * extent, rows[:, 5:])


LAYOUTS = {
    "yolov5": Layout(_classes_yolov5, _decode_yolov5),
    "yolov8": Layout(_classes_yolov8, _decode_yolov8),
    "yolox": Layout(_classes_yolox, _decode_yolox, "corner", True, std=(1, 1, 1)),
    "nanodet": Layout(
        _classes_nanodet,
        _decode_nanodet,
        "stretch",
        True,
        (103.53, 116.28, 123.675),
        (57.375, 57.12, 58.395),
    ),
    "fastestdet": Layout(_classes_fastestdet, _decode_fastestdet, "stretch", True),
    DARKNET: Layout(_classes_darknet, _decode_darknet, "stretch"),
}
"""Layouts by name; YOLOv8 stands for YOLOv11 too, with and without masks."""
