"""Settings of the long-term operation."""

from __future__ import annotations

from dataclasses import dataclass, field

from gslts.change.config import DetectionConfig
from gslts.change.confirmation import MonitorConfig
from gslts.localization.config import RelocalizationConfig
from gslts.mapping.config import PRESETS, MappingConfig
from gslts.update.config import UpdateConfig


def _process_every_frame() -> MonitorConfig:
    """Return settings of a monitor that processes every frame: the robot waits for its result."""
    return MonitorConfig(rate_hz=1e6)


@dataclass(frozen=True)
class KeeperConfig:
    """Settings of the rounds.

    Attributes:
        max_viewpoints: Maximum number of viewpoints in a round.
        max_frames: Maximum number of frames at one viewpoint, while a change is not confirmed.
        monitor: Settings of the confirmation of changes.
        detection: Settings of the change detection.
        update: Settings of updates.
        relocalization: Settings of the localizer of the keeper; None makes none.
        extension: Settings of the mapping of unmapped space.

    Raises:
        ValueError: A number is not positive.
    """

    max_viewpoints: int = 100
    max_frames: int = 4
    monitor: MonitorConfig = field(default_factory=_process_every_frame)
    detection: DetectionConfig = field(default_factory=DetectionConfig)
    update: UpdateConfig = field(default_factory=UpdateConfig)
    relocalization: RelocalizationConfig | None = None
    extension: MappingConfig = PRESETS["fast"]

    def __post_init__(self) -> None:
        for name in ("max_viewpoints", "max_frames"):
            if getattr(self, name) < 1:
                raise ValueError(
                    f"KeeperConfig: {name} must be positive, got {getattr(self, name)}"
                )
