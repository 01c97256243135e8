"""What a change in view is, for those who judge whether it was found."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, Field

from gslts_sim.actions import SceneState
from gslts_sim.ray_scene import RayScene
from gslts_sim.robot_body import Viewpoint
from gslts_sim.strict_model import STRICT
from gslts_sim.task import Change
from gslts_sim.viewpoints import ObjectVisibility

COUNTED_SIZE_PX = (640, 480)
"""Of the images in which objects are counted, whatever the size of those that a robot takes."""


class Truth(BaseModel):
    """A change in view.

    Attributes:
        change: What and where.
        size_px: Pixels of the object, of 640 x 480; the fewer of those before and after where it
            moved.
    """

    model_config = STRICT

    change: Change
    size_px: Annotated[int, Field(ge=0)]


def in_view_px(change: Change, before: SceneState, after: SceneState, look: Viewpoint) -> int:
    """`Truth.size_px` of a change in the view of a look."""
    states = ((change.box_before, before), (change.box_after, after))
    return min(
        ObjectVisibility(state.home, RayScene(state.home), change.object_id).visible_px(
            look, COUNTED_SIZE_PX
        )
        for box, state in states
        if box is not None
    )
