"""Size of a robot."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field


class RobotBody(BaseModel):
    """Upright cylinder on wheels, for obstacles and free space.

    The defaults are those of the simulated robot.

    Attributes:
        radius_m: Radius of the cylinder, m.
        height_m: Height of the cylinder above the floor, m; what is higher is no obstacle.
        step_m: Maximum height of what the robot drives over, such as a rug, m.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    radius_m: Annotated[float, Field(gt=0, le=2)] = 0.2
    height_m: Annotated[float, Field(gt=0, le=5)] = 1.2
    step_m: Annotated[float, Field(ge=0, le=0.5)] = 0.02
