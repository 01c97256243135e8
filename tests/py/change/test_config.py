"""Settings of change detection."""

from typing import Any

import pytest

from gslts.change.config import DetectionConfig


@pytest.mark.parametrize("strategy", ["objects", "gs_lts"])
@pytest.mark.parametrize("halvings", [0, 1, 2])
def test_settings_in_range_are_accepted(strategy: Any, halvings: int) -> None:
    config = DetectionConfig(strategy=strategy, halvings=halvings)
    assert (config.strategy, config.halvings) == (strategy, halvings)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"strategy": "guess"}, "strategy must be one of objects, gs_lts, got 'guess'"),
        ({"strategy": ""}, "strategy must be one of objects, gs_lts, got ''"),
        ({"strategy": "Paper"}, "strategy must be one of objects, gs_lts, got 'Paper'"),
        ({"halvings": -1}, r"halvings must be in 0\.\.2, got -1"),
        ({"halvings": 3}, r"halvings must be in 0\.\.2, got 3"),
        ({"halvings": float("nan")}, r"halvings must be in 0\.\.2, got nan"),
    ],
)
def test_settings_out_of_range_are_named(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=f"^DetectionConfig: {message}$"):
        DetectionConfig(**settings)


@pytest.mark.parametrize(
    ("width_px", "halvings"),
    [(80, 0), (320, 0), (639, 0), (640, 1), (848, 1), (1280, 2), (4000, 2)],
)
def test_frames_are_halved_to_the_width_of_the_fit(width_px: int, halvings: int) -> None:
    assert DetectionConfig().halvings_of(width_px) == halvings
    assert DetectionConfig(halvings=1).halvings_of(width_px) == 1
