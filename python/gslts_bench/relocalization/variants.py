"""Ways to relocalize: the default, with parts left out, and with other settings."""

from __future__ import annotations

from typing import Any

from gslts.localization.config import RelocalizationConfig

OURS = "all"
"""The default, on one thread, as all are."""
LEFT_OUT: dict[str, dict[str, Any]] = {
    "corners alone": {"iterations": 0, "register_clouds": False},
    "corners and clouds": {"iterations": 0},
    "without depth": {"use_depth": False},
    "without clouds": {"register_clouds": False},
}
KNOBS = {
    "halvings": (0, 1, 2),
    "corners": (250, 500, 1000, 2000),
    "iterations": (2, 4, 8, 16),
}
"""Settings that buy accuracy with time, each changed by itself."""


def knob_name(knob: str, value: int) -> str:
    """Of the variant with another value of one of `KNOBS`; the default is `OURS`."""
    return OURS if getattr(_config({}), knob) == value else f"{knob} = {value}"


def _config(changes: dict[str, Any]) -> RelocalizationConfig:
    return RelocalizationConfig(threads=1, **changes)


ABLATION = {name: _config(changes) for name, changes in LEFT_OUT.items()}
TRADE = {
    knob_name(knob, value): _config({knob: value})
    for knob, values in KNOBS.items()
    for value in values
    if knob_name(knob, value) != OURS
}
VARIANTS = {OURS: _config({}), **ABLATION, **TRADE}
