"""Settings of change detection."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, get_args

from gslts._core.detect import GsLtsRule, MaskRule, ObjectRule
from gslts.change.constants import COMPARED_WIDTH_PX, MAX_HALVINGS

__all__ = ["DetectionConfig", "GsLtsRule", "MaskRule", "ObjectRule", "Strategy"]

Strategy = Literal["objects", "gs_lts"]


@dataclass(frozen=True)
class DetectionConfig:
    """Settings of change detection.

    Args:
        strategy: "objects" finds any number of changed objects; "gs_lts" is the rule printed in
            GS-LTS (sec. III-C), at most one change per frame.
        halvings: Number of times the sides of a frame are halved before the comparison, 0 to 2;
            None means as often as it stays at least `COMPARED_WIDTH_PX` wide.
        align_pose: Correct the pose of the frame first, by direct image alignment with the map.
        masks: Thresholds of the difference masks.
        gs_lts: Thresholds of the strategy "gs_lts".
        objects: Thresholds of the strategy "objects". Where depth is fine, an addition or a
            removal has a confidence of at most 0.9: a `min_confidence` of 0.9 or more leaves none.
        threads: Number of threads; 0 means one per hardware thread.

    Raises:
        ValueError: A setting is out of range.
    """

    strategy: Strategy = "objects"
    halvings: int | None = None
    align_pose: bool = True
    masks: MaskRule = field(default_factory=MaskRule)
    gs_lts: GsLtsRule = field(default_factory=GsLtsRule)
    objects: ObjectRule = field(default_factory=ObjectRule)
    threads: int = 1

    def __post_init__(self) -> None:
        if self.strategy not in get_args(Strategy):
            known = ", ".join(get_args(Strategy))
            raise ValueError(
                f"DetectionConfig: strategy must be one of {known}, got {self.strategy!r}"
            )
        if self.halvings is not None and self.halvings not in range(MAX_HALVINGS + 1):
            raise ValueError(
                f"DetectionConfig: halvings must be in 0..{MAX_HALVINGS}, got {self.halvings}"
            )

    def halvings_of(self, width_px: int) -> int:
        """Return the number of halvings of a frame.

        Args:
            width_px: Width of the frame, px.
        """
        if self.halvings is not None:
            return self.halvings
        possible = range(1, MAX_HALVINGS + 1)
        return sum(width_px >> halvings >= COMPARED_WIDTH_PX for halvings in possible)
