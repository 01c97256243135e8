"""The actions of AI2-THOR, with their arguments checked, and what those of a home do to it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, FiniteFloat, TypeAdapter, ValidationError

from gslts_sim import changes
from gslts_sim.changes import ChangeError
from gslts_sim.home import Home, HomeObject
from gslts_sim.physics import OrientedBoxes
from gslts_sim.strict_model import StrictModel

ObjectId = Annotated[str, Field(min_length=1, max_length=1000)]
Metres = Annotated[FiniteFloat, Field(ge=-1e6, le=1e6)]
Degrees = Annotated[FiniteFloat, Field(ge=-3600, le=3600)]

GRID_M = 0.25
"""Length of a step, and distance of the places that the robot knows."""


class Point(StrictModel):
    """A place in the world, m."""

    x: Metres
    y: Metres
    z: Metres


class Place(StrictModel):
    """A place on the floor, m; its height does not count."""

    x: Metres
    y: Metres
    z: Metres = 0.0


class Move(StrictModel):
    """A step ahead or aside, m."""

    action: Literal["MoveAhead", "MoveBack", "MoveLeft", "MoveRight"]
    moveMagnitude: Annotated[FiniteFloat, Field(ge=0, le=100)] = GRID_M  # noqa: N815


class Rotate(StrictModel):
    """A turn about the vertical."""

    action: Literal["RotateLeft", "RotateRight"]
    degrees: Degrees = 90.0


class Tilt(StrictModel):
    """A nod of the camera."""

    action: Literal["LookUp", "LookDown"]
    degrees: Degrees = 30.0


class Teleport(StrictModel):
    """A jump to a place and a direction; what is None stays."""

    action: Literal["Teleport"] = "Teleport"
    position: Place | None = None
    rotation: Degrees | None = None
    horizon: Degrees | None = None


class Pass(StrictModel):
    """Nothing, or a question."""

    action: Literal["Pass", "GetReachablePositions"]


class InitialRandomSpawn(StrictModel):
    """Shuffles the movable objects over all that can carry them."""

    action: Literal["InitialRandomSpawn"] = "InitialRandomSpawn"
    randomSeed: Annotated[int, Field(ge=0)] = 0  # noqa: N815
    numPlacementAttempts: Annotated[int, Field(ge=1, le=1000)] = 5  # noqa: N815


class DisableObject(StrictModel):
    """Takes an object away."""

    action: Literal["DisableObject"] = "DisableObject"
    objectId: ObjectId  # noqa: N815


class EnableObject(StrictModel):
    """Brings an object back to where it was when it was taken away."""

    action: Literal["EnableObject"] = "EnableObject"
    objectId: ObjectId  # noqa: N815


class PlaceObjectAtPoint(StrictModel):
    """Puts an object elsewhere; `rotation` is about the vertical, degrees, None keeps it."""

    action: Literal["PlaceObjectAtPoint"] = "PlaceObjectAtPoint"
    objectId: ObjectId  # noqa: N815
    position: Point
    rotation: Degrees | None = None


ChangeAction = Annotated[
    InitialRandomSpawn | DisableObject | EnableObject | PlaceObjectAtPoint,
    Field(discriminator="action"),
]
AnyAction = Annotated[
    Move | Rotate | Tilt | Teleport | Pass | ChangeAction, Field(discriminator="action")
]

_ADAPTER: TypeAdapter[AnyAction] = TypeAdapter(AnyAction)


@dataclass(frozen=True, eq=False)
class SceneState:
    """A home, and the objects that were taken away from it.

    Args:
        home: As it is.
        removed: By id, as they were.
    """

    home: Home
    removed: Mapping[str, HomeObject] = field(default_factory=dict)

    def apply(self, action: ChangeAction, keep_free: OrientedBoxes | None = None) -> SceneState:
        """The state after an action.

        Args:
            action: What happens.
            keep_free: Where nothing may be put, such as where the robot is.

        Raises:
            ChangeError: It cannot be, and why.
        """
        home, aside = self.home, dict(self.removed)
        match action:
            case InitialRandomSpawn():
                home = changes.spawn_randomly(
                    home, action.randomSeed, action.numPlacementAttempts, keep_free
                )
            case DisableObject():
                home = changes.disable(home, action.objectId)
                aside[action.objectId] = self.home[action.objectId]
            case EnableObject():
                if action.objectId not in aside:
                    there = "is there already" if action.objectId in home else "was never there"
                    raise ChangeError(f"{action.objectId} {there}")
                home = changes.enable(home, aside.pop(action.objectId), keep_free)
            case PlaceObjectAtPoint():
                point = np.array([action.position.x, action.position.y, action.position.z])
                home = changes.place(home, action.objectId, point, action.rotation, keep_free)
        return SceneState(home, aside)

    def apply_all(self, actions: Iterable[ChangeAction]) -> SceneState:
        """The state after some actions.

        Raises:
            ChangeError: One cannot be done, and why.
        """
        state = self
        for action in actions:
            state = state.apply(action)
        return state


def parse_action(name: str, arguments: Mapping[str, Any]) -> AnyAction:
    """An action from its name and its arguments.

    Raises:
        ValueError: There is no such action, or an argument is missing, unknown or no such value.
    """
    try:
        return _ADAPTER.validate_python({**arguments, "action": name})
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        if first["type"] == "union_tag_invalid":
            known = first["ctx"]["expected_tags"]
            raise ValueError(f"action must be one of {known}, got {name!r}") from None
        # Without the names of the types that the union was narrowed to.
        where = ".".join(str(part) for part in first["loc"] if part not in ("change", name))
        raise ValueError(f"{name}: {where}: {first['msg']}") from None
