"""How changes are detected."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, get_args

from gslts._core.detect import GsLtsRule, MaskRule, ObjectRule

__all__ = ["DetectionConfig", "GsLtsRule", "MaskRule", "ObjectRule", "Strategy"]

Strategy = Literal["objects", "paper"]

MOST_HALVINGS = 2
"""To a quarter of the frame's sides, from which its pose is corrected."""


@dataclass(frozen=True)
class DetectionConfig:
    """Settings of the detection.

    Attributes:
        strategy: "paper" is the rule of GS-LTS as printed, one change a frame; "objects" finds any
            number of them.
        halvings: How often the sides of the frame are halved before it is looked at.
        align_pose: Whether the pose is corrected first, by direct image alignment with the map.
        masks: Where frame and map differ.
        paper: Thresholds of that strategy.
        objects: Thresholds of that strategy.
        threads: 0 means one a hardware thread.
    """

    strategy: Strategy = "objects"
    halvings: int = 1
    align_pose: bool = True
    masks: MaskRule = field(default_factory=MaskRule)
    paper: GsLtsRule = field(default_factory=GsLtsRule)
    objects: ObjectRule = field(default_factory=ObjectRule)
    threads: int = 1

    def __post_init__(self) -> None:
        if self.strategy not in get_args(Strategy):
            known = ", ".join(get_args(Strategy))
            raise ValueError(
                f"DetectionConfig: strategy must be one of {known}, got {self.strategy!r}"
            )
        if self.halvings not in range(MOST_HALVINGS + 1):
            raise ValueError(
                f"DetectionConfig: halvings must be in 0..{MOST_HALVINGS}, got {self.halvings}"
            )
