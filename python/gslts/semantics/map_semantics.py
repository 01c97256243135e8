"""What the Gaussians of a map mean, kept up while the map changes."""

from __future__ import annotations

import logging
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.semantics.autoencoder import Autoencoder
from gslts.semantics.categories import classify_gaussians
from gslts.semantics.files import read_semantics
from gslts.semantics.lift import FeatureView, lift_features
from gslts.semantics.registry import open_source
from gslts.semantics.source import SemanticSource

_logger = logging.getLogger(__name__)

LEAST_SHARE = 0.5
"""Of some Gaussians, which must agree on what they are."""


@dataclass(frozen=True, eq=False)
class MapSemantics:
    """How the features of a map are made and read.

    Attributes:
        source: Of what pictures mean.
        autoencoder: Of the features.
        names: Of what the source has words for.
    """

    source: SemanticSource
    autoencoder: Autoencoder
    names: tuple[str, ...]

    @classmethod
    def of_map(cls, path: Path, threads: int = 0) -> MapSemantics | None:
        """That of a map folder; None if nobody taught the map.

        Nor is there one, and a warning tells why, where its models are not at hand: a robot keeps
        its map up to date without them, and what is new has no meaning.

        Raises:
            OSError: A file cannot be read.
            ValueError: A file is damaged.
        """
        found = read_semantics(path)
        if found is None:
            return None
        setting, autoencoder = found
        models = {name: Path(folder) for name, folder in setting.models.items()}
        try:
            teacher = open_source(setting.source, models, threads)
        except (ImportError, FileNotFoundError) as error:
            _logger.warning("%s: what is new will have no meaning: %s", path, error)
            return None
        return cls(teacher, autoencoder, setting.names)

    def update_features(
        self,
        gaussian_map: GaussianMap,
        fresh: NDArray[np.bool_],
        views: Iterable[tuple[RgbdFrame, NDArray[np.bool_]]],
        threads: int = 0,
    ) -> GaussianMap:
        """The map, in which some Gaussians mean what frames show there; others keep theirs.

        Args:
            gaussian_map: float32.
            fresh: [N] Gaussians that may mean something else; if no frame tells, they keep theirs.
            views: Frames, and [H,W] where they are to be believed; those that the source cannot
                read, such as frames without labels, are left out.
            threads: 0 means one a hardware thread.
        """
        code = self.autoencoder.code
        levels = gaussian_map.feature_dims // code
        seen: list[list[FeatureView]] = [[] for _ in range(levels)]
        for frame, believed in views:
            try:
                segments = self.source.segments(frame)
            except ValueError:
                continue
            codes = self.autoencoder.encode(segments.embeddings)
            for level, labels in enumerate(segments.labels[:levels]):
                known = believed & (labels >= 0)
                if known.any():
                    seen[level].append((frame.camera, codes[labels], known))
        features = gaussian_map.features.copy()
        for level, own in enumerate(seen):
            found = lift_features(gaussian_map, own, code, threads)
            told = fresh & found.any(axis=1)
            features[told, level * code : (level + 1) * code] = found[told]
        return replace(gaussian_map, features=features)

    def name_of(self, gaussian_map: GaussianMap, rows: NDArray[np.intp]) -> str | None:
        """What some Gaussians are, if most of those that fit a name agree."""
        found = classify_gaussians(gaussian_map, rows, self.autoencoder, self.source, self.names)
        counts = np.bincount(found + 1, minlength=2)[1:]  # -1 fits none.
        best = int(counts.argmax())
        return self.names[best] if counts[best] > LEAST_SHARE * counts.sum() else None
