"""Settings of relocalization."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field


class RelocalizationConfig(BaseModel):
    """Settings of relocalization: speed against accuracy.

    Attributes:
        keypoints: Maximum number of keypoints of an image. From 250 to 2000, the median error
            changes by less than 0.1 mm and the time from 0.16 to 0.27 s.
        hypotheses: Maximum number of pose hypotheses that are compared with the map.
        halvings: Halvings of the sides of the image at the last step of the refinement: 2.6, 3.4
            and 7.9 mm median error with 0, 1 and 2, in 0.21, 0.18 and 0.14 s.
        iterations: Maximum number of iterations of the refinement at each resolution; 0 means no
            refinement. From 2 to 16, the median error changes by less than 0.1 mm.
        register_clouds: Register the depth image with the surfaces of the map where the depths of
            a coarse pose do not agree.
        use_depth: Use the measured depth.
        threads: Number of threads; 0 means one per hardware thread. Results do not depend on it.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    keypoints: Annotated[int, Field(ge=50, le=10_000)] = 1000
    hypotheses: Annotated[int, Field(ge=1, le=16)] = 4
    halvings: Annotated[int, Field(ge=0, le=8)] = 0
    iterations: Annotated[int, Field(ge=0, le=100)] = 8
    register_clouds: bool = True
    use_depth: bool = True
    threads: Annotated[int, Field(ge=0)] = 0
