"""Settings of relocalization."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field


class RelocalizationConfig(BaseModel):
    """How a pose is looked for; speed against accuracy.

    Attributes:
        corners: Of the picture, at most.
        hypotheses: That are compared with the map.
        halvings: Of the sides of the picture, for the last step of the refinement.
        iterations: Of the refinement at each resolution, at most; 0 means that there is none.
        register_clouds: Whether depth is registered with the map's surfaces where a coarse pose
            does not fit them.
        use_depth: Whether measured depth counts at all.
        threads: 0 means one a hardware thread. Results do not depend on it.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    corners: Annotated[int, Field(ge=50, le=10_000)] = 1000
    hypotheses: Annotated[int, Field(ge=1, le=16)] = 4
    halvings: Annotated[int, Field(ge=0, le=8)] = 0
    iterations: Annotated[int, Field(ge=0, le=100)] = 8
    register_clouds: bool = True
    use_depth: bool = True
    threads: Annotated[int, Field(ge=0)] = 0
