"""Semantics of a map folder, which follow the map through its updates."""

from __future__ import annotations

import logging
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.semantics.categories import classify_gaussians
from gslts.semantics.class_codec import ClassCodec
from gslts.semantics.class_names import read_class_names
from gslts.semantics.files import read_semantics
from gslts.semantics.lift import FeatureView, lift_codes
from gslts.semantics.masks import PixelBox, box_ious, box_of_mask
from gslts.semantics.registry import calibrate_in, open_source
from gslts.semantics.source import Codec, SemanticSource
from gslts.types import Bools, Floats32, Indices

_logger = logging.getLogger(__name__)

MIN_MAJORITY = 0.5
"""Share of the classified Gaussians of an object that must agree on its name: a majority."""
MIN_NAME_SCORE = 0.02
"""Minimum mean score of the class of a detector that names an object. That there is an object is
known, so that it is less than a query needs: a detection of score 0.25 in one of eight views."""

MIN_NAME_IOU = 0.3
"""Minimum intersection over union of an object and of a detection that names it, in an image."""


@dataclass(frozen=True, eq=False)
class MapSemantics:
    """Computes the semantic features of new Gaussians, and names objects.

    Attributes:
        source: Segments frames and encodes names.
        codec: Of the features of the map.
        names: Names of the object types that the map was made with.
    """

    source: SemanticSource
    codec: Codec
    names: tuple[str, ...]

    @classmethod
    def of_map(cls, path: Path, threads: int = 0) -> MapSemantics | None:
        """Read the semantics of a map folder and load its models.

        Args:
            path: A map folder, or a version of it such as MAP@3.
            threads: For the models; 0 uses the default of torch.

        Returns:
            The semantics; None if the map has none, or, with a warning, if its models are not
            available: the map can be updated without them, and new objects have no semantics then.

        Raises:
            OSError: A file cannot be read.
            ValueError: A file is damaged.
        """
        found = read_semantics(path)
        if found is None:
            return None
        cause, codec = found
        models = {name: Path(folder) for name, folder in cause.models.items()}
        try:
            if "names" in models:
                _check_names(models["names"], cause.names)
            source = open_source(cause.source, models, threads, cause.layout)
        except (ImportError, FileNotFoundError, _NamesError) as error:
            _logger.warning("%s: new objects will have no semantic features: %s", path, error)
            return None
        return cls(calibrate_in(path, source, codec), codec, cause.names)

    def update_features(
        self,
        gaussian_map: GaussianMap,
        stale: Bools,
        views: Iterable[tuple[RgbdFrame, Bools]],
        threads: int = 0,
    ) -> GaussianMap:
        """Recompute the features of some Gaussians from frames; the others keep theirs.

        Args:
            gaussian_map: float32, with features.
            stale: [N] Gaussians to recompute; those that no view shows keep their features.
            views: Frames, and masks [H,W] of the pixels to use. Frames that the source cannot
                segment, such as those without labels, are skipped.
            threads: 0 uses one per hardware thread; does not change results.

        Returns:
            The map with the new features.
        """
        code_dims = self.codec.code_dims
        levels = gaussian_map.feature_dims // code_dims
        level_views: list[list[FeatureView]] = [[] for _ in range(levels)]
        for frame, mask in views:
            try:
                segments = self.source.segments(frame)
            except ValueError:
                continue
            codes = self.codec.encode(segments.embeddings)
            for level, labels in enumerate(segments.labels[:levels]):
                wanted = np.where(mask, labels, -1).astype(np.int32)
                if (wanted >= 0).any():
                    level_views[level].append((frame.camera, wanted, codes))
        features = gaussian_map.features.copy()
        for level, feature_views in enumerate(level_views):
            lifted = lift_codes(gaussian_map, feature_views, self.codec, threads)
            changed = stale & lifted.any(axis=1)
            features[changed, level * code_dims : (level + 1) * code_dims] = lifted[changed]
        return replace(gaussian_map, features=features)

    def name_of(self, gaussian_map: GaussianMap, rows: Indices) -> str | None:
        """Name the object that Gaussians belong to.

        By majority vote, or by the class of a detector with the greatest mean score beyond that of
        the surroundings: what a detector sees there, too, is something larger.

        Args:
            gaussian_map: With features.
            rows: [K] rows of the Gaussians of the object.

        Returns:
            The name; None if no name has a majority among the Gaussians that match one, or if the
            detector saw none.
        """
        if isinstance(self.codec, ClassCodec):
            scores = self._mean_scores(gaussian_map, rows)
            scores = scores - self._mean_scores(gaussian_map, _surroundings(gaussian_map, rows))
            best = int(scores.argmax())
            return self.names[best] if scores[best] >= MIN_NAME_SCORE else None
        classes = classify_gaussians(gaussian_map, rows, self.codec, self.source, self.names)
        counts = np.bincount(classes + 1, minlength=2)[1:]  # Without class -1.
        best = int(counts.argmax())
        return self.names[best] if counts[best] > MIN_MAJORITY * counts.sum() else None

    def name_in_frames(self, frames: Iterable[tuple[RgbdFrame, PixelBox]]) -> str | None:
        """Name an object by what a detector sees there in single frames.

        A detection of something larger behind the object, or of a part of it, overlaps too little.

        Args:
            frames: Frames that show the object, and its bounding box in each.

        Returns:
            The class with the greatest sum of scores, weighted by the overlap; None if the
            detector sees nothing there, or the source is no detector.
        """
        if not isinstance(self.codec, ClassCodec):
            return None
        votes = np.zeros(len(self.names), np.float32)
        for frame, box in frames:
            try:
                segments = self.source.segments(frame)
            except ValueError:
                continue
            for row, distribution in enumerate(segments.embeddings[1:], start=1):
                seen = box_of_mask(segments.labels[0] == row)
                if seen is not None:
                    (overlap,) = box_ious(box, np.array([seen], np.float32))
                    votes += distribution[1:] * (overlap if overlap >= MIN_NAME_IOU else 0)
        best = int(votes.argmax())
        return self.names[best] if votes[best] > 0 else None

    @staticmethod
    def _mean_scores(gaussian_map: GaussianMap, rows: Indices) -> Floats32:
        """Return [K] the mean scores of the classes of a detector; 0 without Gaussians."""
        sums = gaussian_map.select(rows).features[:, 1:].sum(axis=0)
        return np.asarray(sums / max(1, len(rows)), np.float32)


class _NamesError(ValueError):
    """A file of names is not the one that a map was made with."""


def _check_names(path: Path, expected: tuple[str, ...]) -> None:
    """Require the names of a map: other ones would give objects the words of other classes."""
    try:
        names, _ = read_class_names(path)
    except ValueError as error:
        raise _NamesError(str(error)) from None
    if names != expected:
        raise _NamesError(f"{path}: it changed since the map got its {len(expected)} names")


def _surroundings(gaussian_map: GaussianMap, rows: Indices) -> Indices:
    """Return the rows of the Gaussians around some, up to the size of their box away."""
    if len(rows) == 0:
        return rows
    means = gaussian_map.select(rows).means
    low, high = means.min(axis=0), means.max(axis=0)
    size, origin = high - low, gaussian_map.origin
    near = gaussian_map.rows_in_box(low - size + origin, high + size + origin)
    return np.setdiff1d(near, rows)
