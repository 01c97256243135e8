"""Variants of relocalization: the default, with parts left out, and with other settings."""

from __future__ import annotations

from typing import Any

from gslts.localization.config import RelocalizationConfig

OURS = "all"
"""Name of the default; all variants run on one thread."""
LEFT_OUT: dict[str, dict[str, Any]] = {
    "keypoints alone": {"iterations": 0, "register_clouds": False},
    "keypoints and clouds": {"iterations": 0},
    "without depth": {"use_depth": False},
    "without clouds": {"register_clouds": False},
}
"""Settings that leave out parts."""
KNOBS = {
    "halvings": (0, 1, 2),
    "keypoints": (250, 500, 1000, 2000),
    "iterations": (2, 4, 8, 16),
}
"""Settings that trade time for accuracy, each changed by itself."""


def knob_name(knob: str, value: int) -> str:
    """Name the variant with a value of one of `KNOBS`; `OURS` for the default's value.

    Args:
        knob: One of `KNOBS`.
        value: Value of the setting.
    """
    return OURS if getattr(_config({}), knob) == value else f"{knob} = {value}"


def _config(changes: dict[str, Any]) -> RelocalizationConfig:
    return RelocalizationConfig(threads=1, **changes)


ABLATION = {name: _config(changes) for name, changes in LEFT_OUT.items()}
"""Variants with parts left out."""
TRADE = {
    knob_name(knob, value): _config({knob: value})
    for knob, values in KNOBS.items()
    for value in values
    if knob_name(knob, value) != OURS
}
"""Variants with another value of a setting."""
VARIANTS = {OURS: _config({}), **ABLATION, **TRADE}
"""All variants by name."""
