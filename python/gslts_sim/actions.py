"""Actions of AI2-THOR and one of our own, `ShiftObject`, and their effects on a home."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, FiniteFloat, TypeAdapter, ValidationError

from gslts_sim import changes
from gslts_sim.changes import ChangeError
from gslts_sim.home import Home, HomeObject
from gslts_sim.oriented_boxes import OrientedBoxes
from gslts_sim.strict_model import StrictModel

ObjectId = Annotated[str, Field(min_length=1, max_length=1000)]
Metres = Annotated[FiniteFloat, Field(ge=-1e6, le=1e6)]
Degrees = Annotated[FiniteFloat, Field(ge=-3600, le=3600)]
GRID_M = 0.25
"""Default step length and spacing of the grid of reachable positions, m: AI2-THOR's default."""


class Point(StrictModel):
    """Position in the world, m."""

    x: Metres
    y: Metres
    z: Metres


class FloorPosition(StrictModel):
    """Position on the floor, m; its height is ignored."""

    x: Metres
    y: Metres
    z: Metres = 0.0


class Move(StrictModel):
    """Step in one of four directions; `moveMagnitude` is its length, m."""

    action: Literal["MoveAhead", "MoveBack", "MoveLeft", "MoveRight"]
    moveMagnitude: Annotated[FiniteFloat, Field(ge=0, le=100)] = GRID_M  # noqa: N815


class Rotate(StrictModel):
    """Turn about the vertical."""

    action: Literal["RotateLeft", "RotateRight"]
    degrees: Degrees = 90.0


class Tilt(StrictModel):
    """Tilt of the camera."""

    action: Literal["LookUp", "LookDown"]
    degrees: Degrees = 30.0


class Teleport(StrictModel):
    """Jump to a position, a yaw and a horizon; None keeps the current value."""

    action: Literal["Teleport"] = "Teleport"
    position: FloorPosition | None = None
    rotation: Degrees | None = None
    horizon: Degrees | None = None


class Pass(StrictModel):
    """Action that changes nothing."""

    action: Literal["Pass", "GetReachablePositions"]


class InitialRandomSpawn(StrictModel):
    """Shuffle of the movable objects over the receptacles that can carry them."""

    action: Literal["InitialRandomSpawn"] = "InitialRandomSpawn"
    randomSeed: Annotated[int, Field(ge=0)] = 0  # noqa: N815
    numPlacementAttempts: Annotated[int, Field(ge=1, le=1000)] = 5  # noqa: N815


class DisableObject(StrictModel):
    """Removal of an object."""

    action: Literal["DisableObject"] = "DisableObject"
    objectId: ObjectId  # noqa: N815


class EnableObject(StrictModel):
    """Return of a removed object to its last pose."""

    action: Literal["EnableObject"] = "EnableObject"
    objectId: ObjectId  # noqa: N815


class PlaceObjectAtPoint(StrictModel):
    """Move of an object to a position; `rotation` is its new yaw, degrees, None keeps it."""

    action: Literal["PlaceObjectAtPoint"] = "PlaceObjectAtPoint"
    objectId: ObjectId  # noqa: N815
    position: Point
    rotation: Degrees | None = None


class ShiftObject(StrictModel):
    """Push of an object by `dx` and `dy` in the world, m, with all that stands on it.

    It turns by `degrees` about the vertical. AI2-THOR has no such action.
    """

    action: Literal["ShiftObject"] = "ShiftObject"
    objectId: ObjectId  # noqa: N815
    dx: Metres = 0.0
    dy: Metres = 0.0
    degrees: Degrees = 0.0


ChangeAction = Annotated[
    InitialRandomSpawn | DisableObject | EnableObject | PlaceObjectAtPoint | ShiftObject,
    Field(discriminator="action"),
]
AnyAction = Annotated[
    Move | Rotate | Tilt | Teleport | Pass | ChangeAction, Field(discriminator="action")
]

_ADAPTER: TypeAdapter[AnyAction] = TypeAdapter(AnyAction)
"""Validator of actions."""


@dataclass(frozen=True, eq=False)
class SceneState:
    """A home, and the objects that were removed from it.

    Args:
        home: Its current state.
        removed: Removed objects at their last pose, by id.
    """

    home: Home
    removed: Mapping[str, HomeObject] = field(default_factory=dict)

    def apply(self, action: ChangeAction, keep_free: OrientedBoxes | None = None) -> SceneState:
        """Return the state after an action.

        Args:
            action: A change of the home.
            keep_free: Boxes that must stay free, such as the robot's body.

        Raises:
            ChangeError: The action is impossible; the message says why.
        """
        home, removed = self.home, dict(self.removed)
        match action:
            case InitialRandomSpawn():
                home = changes.spawn_randomly(
                    home, action.randomSeed, action.numPlacementAttempts, keep_free
                )
            case DisableObject():
                home = changes.disable(home, action.objectId)
                removed[action.objectId] = self.home[action.objectId]
            case EnableObject():
                if action.objectId not in removed:
                    reason = "is there already" if action.objectId in home else "was never there"
                    raise ChangeError(f"{action.objectId} {reason}")
                home = changes.enable(home, removed.pop(action.objectId), keep_free)
            case PlaceObjectAtPoint():
                point = np.array([action.position.x, action.position.y, action.position.z])
                home = changes.place(home, action.objectId, point, action.rotation, keep_free)
            case ShiftObject():
                home = changes.shift(
                    home, action.objectId, action.dx, action.dy, action.degrees, keep_free
                )
        return SceneState(home, removed)

    def apply_all(self, actions: Iterable[ChangeAction]) -> SceneState:
        """Return the state after several actions.

        Args:
            actions: Changes of the home, in this order.

        Raises:
            ChangeError: An action is impossible; the message says why.
        """
        state = self
        for action in actions:
            state = state.apply(action)
        return state


def parse_action(name: str, arguments: Mapping[str, Any]) -> AnyAction:
    """Validate an action.

    Args:
        name: Name of the action.
        arguments: Its arguments, by name.

    Raises:
        ValueError: The action is unknown, or an argument is missing, unknown or invalid.
    """
    try:
        return _ADAPTER.validate_python({**arguments, "action": name})
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        if first["type"] == "union_tag_invalid":
            known = first["ctx"]["expected_tags"]
            raise ValueError(f"action must be one of {known}, got {name!r}") from None
        # Drops the tags of the unions from the location.
        where = ".".join(str(part) for part in first["loc"] if part not in ("change", name))
        raise ValueError(f"{name}: {where}: {first['msg']}") from None
