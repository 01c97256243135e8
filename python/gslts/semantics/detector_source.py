"""Semantic source of a detector: the class distribution of each pixel, with the class "nothing".

Lifted to a Gaussian, it is the mean over all views that see it, weighted by its pixels. A view in
which the detector misses an object counts for "nothing", so that a single false detection vanishes
among the views without it, and near views, which have more pixels, count more.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from gslts.core.frame import RgbdFrame
from gslts.semantics.box_masks import box_mask
from gslts.semantics.class_codec import ClassCodec
from gslts.semantics.class_names import ClassNames, read_class_names
from gslts.semantics.detector import Detections, Detector
from gslts.semantics.masks import box_ious, paint_labels
from gslts.semantics.source import Segments
from gslts.semantics.text_model import TextModel
from gslts.types import Floats32, Indices

SAME_IOU = 0.6
"""Boxes of different classes with a larger intersection over union show one object, whose class is
uncertain."""


class DetectorSource:
    """Segments frames with a detector, and finds the class that a text means.

    Args:
        names: Names of the classes.
        detector: Detects the objects of a frame; None if only texts are encoded.
        columns: [C] for each class of the detector, its row in `names`; -1 leaves it out. None
            means that they are the same.

    Attributes:
        names: Names of the classes.
    """

    unrelated: tuple[str, ...] = ()
    threshold = 0.1
    """Minimum mean score of a Gaussian over all views that see it. Small detectors find a cup in a
    third to a half of the views, with scores of 0.3 to 0.9."""

    def __init__(
        self,
        names: ClassNames,
        detector: Callable[[RgbdFrame], Detections] | None = None,
        columns: Indices | None = None,
    ) -> None:
        self.names = names.names
        self._classes, self._detector = names, detector
        self._columns = np.arange(len(self.names)) if columns is None else columns

    @classmethod
    def from_files(
        cls, model: Path, names: Path, layout: str | None = None, text_model: Path | None = None
    ) -> DetectorSource:
        """Open a detector.

        Args:
            model: ONNX file, or `.weights` of Darknet.
            names: Names of its classes, one per line.
            layout: Layout of its outputs; None recognizes it.
            text_model: Folder of a model of sentence embeddings; None for none.

        Returns:
            The source.

        Raises:
            ImportError: A package is missing.
            OSError: A file is missing.
            ValueError: A file is damaged, or the names do not fit the model.
        """
        all_names, columns = read_class_names(names)
        detector = Detector(model, len(columns), layout)
        return cls(
            ClassNames(all_names, None if text_model is None else TextModel(text_model)),
            lambda frame: detector(frame.rgb),
            columns,
        )

    @property
    def dims(self) -> int:
        """Number of classes, with "nothing" as the first."""
        return 1 + len(self.names)

    @property
    def codec(self) -> ClassCodec:
        """Codec of class distributions."""
        return ClassCodec(self.dims)

    def segments(self, frame: RgbdFrame) -> Segments:
        """Return one level of masks: background, and the objects that were detected.

        Args:
            frame: With colours; depth separates objects from what is behind and below them.

        Returns:
            Masks, class distributions and names; smaller objects lie on larger ones.

        Raises:
            ValueError: The source has no detector, or that fails.
        """
        if self._detector is None:
            raise ValueError("DetectorSource: it has no detector to segment frames with")
        frame = frame.registered()
        found = self._detector(frame)
        columns = self._columns[found.classes]
        kept = np.flatnonzero(columns >= 0)
        distributions = np.zeros((1 + len(kept), self.dims), np.float32)
        for row, detection in enumerate(kept, start=1):
            same = kept[box_ious(found.boxes[detection], found.boxes[kept]) >= SAME_IOU]
            np.maximum.at(distributions[row], 1 + columns[same], found.scores[same])
        distributions /= np.maximum(1, distributions.sum(axis=1, keepdims=True))
        distributions[:, 0] = 1 - distributions.sum(axis=1)
        if found.masks is not None:
            masks = found.masks[kept]
        else:
            boxes = found.boxes[kept]
            masks = np.zeros((len(kept), *frame.rgb.shape[:2]), np.bool_)
            for row, box in enumerate(boxes):
                masks[row] = box_mask(frame.rgb, frame.depth, frame.camera, box)
        labels = paint_labels(masks) + 1
        if frame.mask is not None:
            labels[~frame.mask] = -1
        names = ("", *(self.names[column] for column in columns[kept]))
        return Segments(labels[None].astype(np.int32), distributions, names)

    def encode(self, texts: Sequence[str]) -> Floats32:
        """Find the classes that texts mean.

        Args:
            texts: Such as names of objects.

        Returns:
            [T,D] float32, 1 for the class; all 0 for a text that means none.
        """
        result = np.zeros((len(texts), self.dims), np.float32)
        for row, text in enumerate(texts):
            understood = self._classes.understand(text)
            if understood is not None:
                result[row, 1 + self.names.index(understood.name)] = 1
        return result

    def relevance(self, to_query: Floats32, to_canonical: Floats32) -> Floats32:  # noqa: ARG002
        """Return the probability of the class of a query.

        Args:
            to_query: [S] float32, this probability.
            to_canonical: Not used: "nothing" is a class.
        """
        return to_query

    def explain(self, text: str) -> str:
        """Explain which class a text means, unless it is its name.

        Args:
            text: Such as "mug".

        Returns:
            Such as '"mug": understood as cup (0.83)'; empty for a name.
        """
        return self._classes.explain(text)
