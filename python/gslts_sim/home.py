"""A home: named objects with places, the rooms they stand in, and the lights above them."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gslts.types import Floats
from gslts_sim.mesh import Surface


def pose(x: float, y: float, z: float, yaw_rad: float) -> Floats:
    """[4,4] float64: a place, turned about the vertical."""
    # Rounded, so that the last bits of sines and products do not depend on the machine.
    cosine, sine = round(math.cos(yaw_rad), 12), round(math.sin(yaw_rad), 12)
    x, y, z = (round(float(length), 6) for length in (x, y, z))
    return np.array([[cosine, -sine, 0, x], [sine, cosine, 0, y], [0, 0, 1, z], [0, 0, 0, 1.0]])


@dataclass(frozen=True, eq=False)
class AreaLight:
    """A parallelogram that shines to the side of cross(edge_u, edge_v).

    Args:
        center: (3,) float64, m.
        edge_u: (3,) float64, m, from one side to the other.
        edge_v: (3,) float64, m.
        radiance: (3,) float64, linear RGB, such that a white diffuse surface under a radiance
            of 1 from the whole half-space has the value 1.
        owner: Id of the object that it is part of, such as a lamp; None if of none.
    """

    center: Floats
    edge_u: Floats
    edge_v: Floats
    radiance: Floats
    owner: str | None = None

    def moved(self, world_from_object: Floats, owner: str) -> AreaLight:
        """The light of an object, given in its frame, in the world."""
        rotation = world_from_object[:3, :3]
        return AreaLight(
            center=rotation @ self.center + world_from_object[:3, 3],
            edge_u=rotation @ self.edge_u,
            edge_v=rotation @ self.edge_v,
            radiance=self.radiance,
            owner=owner,
        )


@dataclass(frozen=True, eq=False)
class HomeObject:
    """A thing in a home.

    Its own frame has z up and the origin in the middle of the bottom: an object placed at a point
    stands on it.

    Args:
        id: Unique in the home, such as `Mug|3`.
        type: Such as `Mug`.
        surfaces: What it looks like.
        boxes: [B,2,3] float64, m: lower and upper corners, in its own frame, of boxes that together
            fill it closely enough to decide what collides and what can stand on it.
        world_from_object: [4,4] float64, rigid: x_in_world = world_from_object @ x_in_object.
        movable: Whether people carry it about.
        receptacle: Whether other things may stand on it or in it.
        parent: Id of the receptacle that it stands on; None for what belongs to the building.
        lights: In its own frame; they go where it goes.
    """

    id: str
    type: str
    surfaces: tuple[Surface, ...]
    boxes: Floats
    world_from_object: Floats
    movable: bool = False
    receptacle: bool = False
    parent: str | None = None
    lights: tuple[AreaLight, ...] = ()

    def __post_init__(self) -> None:
        if not self.surfaces:
            raise ValueError(f"HomeObject {self.id}: there is no surface")
        if self.boxes.ndim != 3 or self.boxes.shape[1:] != (2, 3) or len(self.boxes) == 0:
            raise ValueError(
                f"HomeObject {self.id}: boxes: expected [B,2,3], got {self.boxes.shape}"
            )
        if not np.all(self.boxes[:, 0] <= self.boxes[:, 1]):
            raise ValueError(f"HomeObject {self.id}: boxes: a lower corner is above the upper")
        rotation = self.world_from_object[:3, :3]
        if self.world_from_object.shape != (4, 4) or not np.allclose(
            rotation @ rotation.T, np.eye(3), atol=1e-6
        ):
            raise ValueError(f"HomeObject {self.id}: world_from_object: expected a rigid transform")

    @cached_property
    def box_in_world(self) -> Floats:
        """[2,3] lower and upper corner of the axis-aligned box around its vertices, m."""
        vertices = np.concatenate([surface.vertices for surface in self.surfaces])
        in_world = vertices @ self.world_from_object[:3, :3].T + self.world_from_object[:3, 3]
        return np.stack([in_world.min(axis=0), in_world.max(axis=0)])

    def place_at(self, world_from_object: Floats, parent: str | None) -> HomeObject:
        """The same object at another place."""
        return replace(self, world_from_object=world_from_object, parent=parent)


def yaw_of(thing: HomeObject) -> float:
    """Its turn about the vertical, rad."""
    return float(np.arctan2(thing.world_from_object[1, 0], thing.world_from_object[0, 0]))


@dataclass(frozen=True, eq=False)
class Room:
    """A room of a home.

    Args:
        type: `kitchen`, `living_room`, `bedroom` or what a file calls it.
        box: [2,3] float64, m: lower and upper corner of the space inside its walls.
    """

    type: str
    box: Floats


@dataclass(frozen=True, eq=False)
class Home:
    """A home, at one moment; changes make new ones.

    World frame: metres, z up, the floor at z = 0.

    Args:
        name: What people call it, such as `kitchen 12`.
        rooms: At least one.
        objects: All things, the building's own (walls, floor, ceiling, windows, doors) among them.
        lights: Those that are no part of an object, such as daylight.
        ambient: (3,) float64, linear RGB: light from everywhere.

    Raises:
        ValueError: Two objects share an id, or a parent does not exist.
    """

    name: str
    rooms: tuple[Room, ...]
    objects: tuple[HomeObject, ...]
    lights: tuple[AreaLight, ...]
    ambient: Floats

    def __post_init__(self) -> None:
        if len(self._by_id) < len(self.objects):
            ids = [thing.id for thing in self.objects]
            twice = next(name for name in ids if ids.count(name) > 1)
            raise ValueError(f"Home {self.name}: id {twice} occurs more than once")
        for thing in self.objects:
            if thing.parent is not None and thing.parent not in self._by_id:
                raise ValueError(
                    f"Home {self.name}: {thing.id} stands on {thing.parent}, not there"
                )

    @cached_property
    def _by_id(self) -> dict[str, HomeObject]:
        return {thing.id: thing for thing in self.objects}

    @cached_property
    def space(self) -> Room:
        """All rooms as one."""
        corners = np.stack([room.box for room in self.rooms])
        box = np.stack([corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)])
        return Room("home", box)

    @cached_property
    def all_lights(self) -> tuple[AreaLight, ...]:
        """Its lights and those of its objects, in the world."""
        of_objects = [
            light.moved(thing.world_from_object, thing.id)
            for thing in self.objects
            for light in thing.lights
        ]
        return (*self.lights, *of_objects)

    def __contains__(self, object_id: str) -> bool:
        return object_id in self._by_id

    def __getitem__(self, object_id: str) -> HomeObject:
        """The object of this id.

        Raises:
            KeyError: There is none.
        """
        return self._by_id[object_id]

    def without(self, object_ids: Iterable[str]) -> Home:
        """The home without some objects; what stood on them must be among them."""
        gone = set(object_ids)
        return replace(
            self,
            objects=tuple(thing for thing in self.objects if thing.id not in gone),
        )

    def with_object(self, thing: HomeObject) -> Home:
        """The home with one object more, or in the place of that with the same id."""
        if thing.id not in self:
            return replace(self, objects=(*self.objects, thing))
        return replace(self, objects=tuple(thing if o.id == thing.id else o for o in self.objects))
