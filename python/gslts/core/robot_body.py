"""The room that a robot takes up."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field


class RobotBody(BaseModel):
    """An upright cylinder on wheels.

    Attributes:
        radius_m: Of the cylinder.
        height_m: Of the cylinder above the floor; what hangs higher is no obstacle.
        step_m: It drives over what is no higher.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    radius_m: Annotated[float, Field(gt=0, le=2)] = 0.2
    height_m: Annotated[float, Field(gt=0, le=5)] = 1.2
    step_m: Annotated[float, Field(ge=0, le=0.5)] = 0.02
