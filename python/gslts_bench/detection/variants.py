"""The change detectors that are compared."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from gslts.change.config import DetectionConfig
from gslts.change.detector import ChangeDetector
from gslts.change.features import FeatureExtractor, OrientedGradients
from gslts.core.camera import Camera
from gslts.core.gaussian_map import GaussianMap
from gslts.types import Floats32


class NoFeatures:
    """Everything is alike, so that features tell nothing."""

    def __call__(self, rgb: Floats32) -> Floats32:  # noqa: ARG002
        """See `FeatureExtractor`."""
        return np.ones((1, 1, 1), np.float32)


@dataclass(frozen=True)
class Variant:
    """One detector; it runs on one thread, as its time is that of one core.

    Attributes:
        config: Settings.
        features: Extractor.
        locate: Whether it is told no pose: the map tells where frames were taken.
    """

    config: DetectionConfig
    features: FeatureExtractor = field(default_factory=OrientedGradients)
    locate: bool = False

    def detector(self, gaussian_map: GaussianMap, cameras: Iterable[Camera]) -> ChangeDetector:
        """The detector for a map, made from frames of those cameras."""
        return ChangeDetector(gaussian_map, self.config, features=self.features, cameras=cameras)


STRATEGIES = {
    "objects": Variant(DetectionConfig(strategy="objects", threads=1)),
    "located": Variant(DetectionConfig(strategy="objects", threads=1), locate=True),
    "paper": Variant(DetectionConfig(strategy="paper", threads=1)),
}
"""Those that are compared in all parts of the benchmark."""

HALVINGS = {"full": 0, "half": 1, "quarter": 2}
FEATURES: dict[str, FeatureExtractor] = {
    "gradients": OrientedGradients(),
    "fine gradients": OrientedGradients(halvings=0),
    "no features": NoFeatures(),
}
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
"""Speed against accuracy; by the resolution of the frame, the features, and whether the pose is
corrected. All use the strategy `objects`."""
VARIANTS = {**STRATEGIES, **TRADE}
