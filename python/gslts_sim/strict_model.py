"""Base of the models that are read from JSON scripts and from actions of the robot."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict

STRICT = ConfigDict(frozen=True, extra="forbid", strict=True)
"""Immutable; unknown fields and values of another type are errors, never converted."""


class StrictModel(BaseModel):
    """An immutable model that rejects unknown fields and values of another type."""

    model_config = STRICT
