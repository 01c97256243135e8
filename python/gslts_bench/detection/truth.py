"""Ground truth of a change in view."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import BaseModel, Field, FiniteFloat

from gslts.types import Floats
from gslts_sim.actions import SceneState
from gslts_sim.ray_scene import RayScene
from gslts_sim.robot_body import Viewpoint
from gslts_sim.strict_model import STRICT
from gslts_sim.task import Change
from gslts_sim.viewpoints import ObjectVisibility

COUNTED_SIZE_PX = (640, 480)
"""Image size in which pixels of objects are counted, whatever the size of the robot's images."""
Row = tuple[FiniteFloat, FiniteFloat, FiniteFloat, FiniteFloat]
Motion = tuple[Row, Row, Row, Row]
"""Rows of a rigid transform in the world, m: x_after = motion @ x_before."""


class Truth(BaseModel):
    """A change in view.

    Attributes:
        change: Object, type and boxes.
        size_px: Pixels of the object, of 640 x 480; the smaller of the numbers before and after
            where it was relocated or shifted.
        motion: Motion of a shifted object, and of all that stands on it; None for other kinds.
    """

    model_config = STRICT

    change: Change
    size_px: Annotated[int, Field(ge=0)]
    motion: Motion | None = None


def in_view_px(change: Change, before: SceneState, after: SceneState, viewpoint: Viewpoint) -> int:
    """Count the pixels of a changed object; see `Truth.size_px`.

    Args:
        change: The change.
        before: State of the home before it.
        after: State of the home after it.
        viewpoint: Viewpoint of the robot.
    """
    states = ((change.box_before, before), (change.box_after, after))
    counts = []
    for box, state in states:
        if box is not None:
            visibility = ObjectVisibility(state.home, RayScene(state.home), change.object_id)
            counts.append(visibility.visible_px(viewpoint, COUNTED_SIZE_PX))
    return min(counts)


def as_motion(world_from_world: Floats) -> Motion:
    """Return a rigid transform [4,4] in the world as a JSON value.

    Args:
        world_from_world: x_after = world_from_world @ x_before, m.
    """
    a, b, c, d = (tuple(row) for row in np.asarray(world_from_world, np.float64).tolist())
    return a, b, c, d
