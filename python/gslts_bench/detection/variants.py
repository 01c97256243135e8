"""Change detectors that are compared."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from gslts.change.config import DetectionConfig
from gslts.change.detector import ChangeDetector
from gslts.change.features import FeatureExtractor, OrientedGradients
from gslts.types import Floats32


class NoFeatures:
    """Features that are the same everywhere, to measure detection without them."""

    def __call__(self, rgb: Floats32) -> Floats32:  # noqa: ARG002
        """Return one feature for the whole image; see `FeatureExtractor`."""
        return np.ones((1, 1, 1), np.float32)


@dataclass(frozen=True)
class Variant:
    """Change detector that runs on one thread, as its time is that of one core.

    Attributes:
        config: Settings.
        features: Feature extractor.
        locate: Whether frames come without a pose and are localized in the map.
    """

    config: DetectionConfig
    features: FeatureExtractor = field(default_factory=OrientedGradients)
    locate: bool = False

    def detector(self, folder: Path) -> ChangeDetector:
        """Make the detector for a map.

        Args:
            folder: Folder of the map.
        """
        return ChangeDetector.of_map(folder, self.config, features=self.features)


STRATEGIES = {
    "objects": Variant(DetectionConfig(strategy="objects", threads=1)),
    "located": Variant(DetectionConfig(strategy="objects", threads=1), locate=True),
    "gs_lts": Variant(DetectionConfig(strategy="gs_lts", threads=1)),
}
"""Detectors that are compared in all parts of the benchmark; `gs_lts` is the printed rule."""

HALVINGS = {"full": 0, "half": 1, "quarter": 2}
"""Resolutions of the trade-off, by number of halvings."""
FEATURES: dict[str, FeatureExtractor] = {
    "gradients": OrientedGradients(),
    "fine gradients": OrientedGradients(halvings=0),
    "no features": NoFeatures(),
}
"""Feature extractors of the trade-off."""
TRADE = {
    **{
        f"{size}, {name}": Variant(DetectionConfig(halvings=halvings, threads=1), features)
        for size, halvings in HALVINGS.items()
        for name, features in FEATURES.items()
    },
    **{
        f"{size}, gradients, pose as given": Variant(
            DetectionConfig(halvings=halvings, align_pose=False, threads=1)
        )
        for size, halvings in HALVINGS.items()
    },
}
"""Variants of `objects` for speed against accuracy: by resolution, features and alignment of the
pose."""
VARIANTS = {**STRATEGIES, **TRADE}
"""All detectors by name."""
