"""Detector simulated from labels, with misses, false detections and wrong names."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gslts.core.frame import RgbdFrame
from gslts.semantics.detector import Detections
from gslts.types import Bools, Floats32

MISSED, FALSE, WRONG = 0.3, 0.1, 0.1
"""Shares of the visible objects that are missed in an image, that have a false detection beside
them, and of the detections that have a wrong name."""
SCORES = (0.3, 0.95)
"""Range of the scores, of false detections too."""
MIN_SIDE_PX, MIN_PIXELS = 12, 60
"""Minimum size of a visible object that is detected, as of small networks."""
SIDE_ERROR = 0.05
"""Standard deviation of a side of a box as a share of the length of the box."""
SURFACES = ("Wall", "Floor", "Ceiling", "Window", "Door", "Doorway")
"""Types that no detector has as classes."""


class NoisyDetector:
    """Detects labelled objects, with errors that differ from image to image.

    Args:
        names: Names of the classes; other objects are not detected.
        seed: For the errors.
        masks: Whether detections have masks, those of the labels; false ones are rectangles.
    """

    def __init__(self, names: Sequence[str], seed: int, *, masks: bool = False) -> None:
        self._number = {name: number for number, name in enumerate(names)}
        self._rng, self._masks = np.random.default_rng(seed), masks

    def __call__(self, frame: RgbdFrame) -> Detections:
        """Detect the objects of an image.

        Args:
            frame: With labels.

        Raises:
            ValueError: The frame has no labels.
        """
        if frame.labels is None:
            raise ValueError("NoisyDetector: the frame has no labels")
        rng, height, width = self._rng, *frame.rgb.shape[:2]
        boxes: list[Floats32] = []
        classes: list[int] = []
        masks: list[Bools] = []
        for instance, name in enumerate(frame.labels.types):
            mask = frame.labels.instances == instance
            box = _box_of(mask)
            if name not in self._number or box is None:
                continue
            if rng.random() >= MISSED:
                sides = np.tile(box[2:] - box[:2], 2)
                boxes.append((box + rng.normal(0, SIDE_ERROR, 4) * sides).astype(np.float32))
                is_wrong = rng.random() < WRONG
                classes.append(self._any() if is_wrong else self._number[name])
                masks.append(mask)
            if rng.random() < FALSE:
                corner, size = rng.random(2) * (width, height), rng.uniform(0.05, 0.4, 2) * width
                boxes.append(np.concatenate([corner, corner + size]).astype(np.float32))
                classes.append(self._any())
                (left, top), (right, bottom) = corner.astype(int), (corner + size).astype(int)
                false = np.zeros((height, width), np.bool_)
                false[top:bottom, left:right] = True
                masks.append(false)
        limits = np.array([width, height, width, height], np.float32)
        clipped = np.array(boxes, np.float32).reshape(-1, 4).clip(0, limits)
        scores = rng.uniform(*SCORES, len(boxes)).astype(np.float32)
        stacked = np.array(masks, np.bool_).reshape(-1, height, width) if self._masks else None
        return Detections(clipped, scores, np.array(classes, np.intp), stacked)

    def _any(self) -> int:
        return int(self._rng.integers(len(self._number)))


def _box_of(mask: Bools) -> Floats32 | None:
    """Return left, top, right and bottom of a mask [H,W], px; None if it is too small."""
    if np.count_nonzero(mask) < MIN_PIXELS:
        return None
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    box = np.array([columns[0], rows[0], columns[-1] + 1, rows[-1] + 1], np.float32)
    return box if (box[2:] - box[:2]).min() >= MIN_SIDE_PX else None
