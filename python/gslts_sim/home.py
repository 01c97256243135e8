"""A home: its objects with their poses, its rooms and its lights."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from gslts.types import Floats
from gslts_sim.mesh import Surface


def pose(x: float, y: float, z: float, yaw_rad: float) -> Floats:
    """Return the pose of an upright object.

    Args:
        x: In the world, m.
        y: In the world, m.
        z: In the world, m.
        yaw_rad: About the vertical, rad.

    Returns:
        [4,4] float64 world_from_object.
    """
    # Rounded, so that the last bits of sines and products do not depend on the machine.
    cosine, sine = round(math.cos(yaw_rad), 12), round(math.sin(yaw_rad), 12)
    x, y, z = (round(float(length), 6) for length in (x, y, z))
    return np.array([[cosine, -sine, 0, x], [sine, cosine, 0, y], [0, 0, 1, z], [0, 0, 0, 1.0]])


@dataclass(frozen=True, eq=False)
class AreaLight:
    """A parallelogram that emits light to the side of cross(edge_u, edge_v).

    Args:
        center: (3,) float64, m.
        edge_u: (3,) float64, m, from one side to the other.
        edge_v: (3,) float64, m, from one side to the other.
        radiance: (3,) float64, linear RGB; a radiance of 1 from the whole half-space gives a white
            diffuse surface the value 1.
        owner: Id of the object that the light belongs to, such as a lamp; None for daylight.
    """

    center: Floats
    edge_u: Floats
    edge_v: Floats
    radiance: Floats
    owner: str | None = None

    def to_world(self, world_from_object: Floats, owner: str) -> AreaLight:
        """Return a light that is given in the frame of an object, in the world.

        Args:
            world_from_object: [4,4] float64, pose of the object, m.
            owner: Id of the object.
        """
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
    """An object of a home: its shape, its pose and its role.

    Its own frame has z up and the origin in the middle of its underside: an object placed at a
    point stands on that point.

    Args:
        id: Unique in the home, such as `Mug|3`.
        type: Such as `Mug`.
        surfaces: Textured triangles, in its own frame.
        boxes: [B,2,3] float64, m: lower and upper corners, in its own frame, of boxes that together
            fill it; they decide about collisions and support.
        world_from_object: [4,4] float64, rigid: x_in_world = world_from_object @ x_in_object.
        movable: Whether people carry it about.
        receptacle: Whether other objects may stand on it or in it.
        parent: Id of the receptacle that it stands on; None for parts of the building.
        lights: In its own frame; they move with it.

    Raises:
        ValueError: An argument has a wrong shape, or the pose is not rigid.
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
        """Return the object at another pose.

        Args:
            world_from_object: [4,4] float64, rigid, m.
            parent: Id of the receptacle that it stands on there.
        """
        return replace(self, world_from_object=world_from_object, parent=parent)


def yaw_of(obj: HomeObject) -> float:
    """Return the yaw of an object, rad.

    Args:
        obj: An upright object.
    """
    return float(np.arctan2(obj.world_from_object[1, 0], obj.world_from_object[0, 0]))


@dataclass(frozen=True, eq=False)
class Room:
    """A room of a home.

    Args:
        type: `kitchen`, `living_room`, `bedroom` or the type that a file gives.
        box: [2,3] float64, m: lower and upper corner of the space inside its walls.
    """

    type: str
    box: Floats


@dataclass(frozen=True, eq=False)
class Home:
    """An immutable state of a home; changes make new homes.

    World frame: metres, z up, the floor at z = 0.

    Args:
        name: For people, such as `kitchen 12`.
        rooms: At least one.
        objects: All objects, those of the building (walls, floor, ceiling, windows, doors) too.
        lights: Those that belong to no object, such as daylight.
        ambient: (3,) float64, linear RGB: light from all directions.

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
            ids = [obj.id for obj in self.objects]
            duplicate = next(name for name in ids if ids.count(name) > 1)
            raise ValueError(f"Home {self.name}: id {duplicate} occurs more than once")
        for obj in self.objects:
            if obj.parent is not None and obj.parent not in self._by_id:
                raise ValueError(
                    f"Home {self.name}: parent {obj.parent} of {obj.id} does not exist"
                )

    @cached_property
    def _by_id(self) -> dict[str, HomeObject]:
        return {obj.id: obj for obj in self.objects}

    @cached_property
    def space(self) -> Room:
        """Box around all rooms, as one room."""
        corners = np.stack([room.box for room in self.rooms])
        box = np.stack([corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)])
        return Room("home", box)

    @cached_property
    def all_lights(self) -> tuple[AreaLight, ...]:
        """Lights of the home and of its objects, in the world."""
        of_objects = [
            light.to_world(obj.world_from_object, obj.id)
            for obj in self.objects
            for light in obj.lights
        ]
        return (*self.lights, *of_objects)

    def __contains__(self, object_id: str) -> bool:
        return object_id in self._by_id

    def __getitem__(self, object_id: str) -> HomeObject:
        return self._by_id[object_id]

    def without(self, object_ids: Iterable[str]) -> Home:
        """Return the home without some objects.

        Args:
            object_ids: Ids of the objects and of all that stands on them.

        Raises:
            ValueError: An object that remains stands on a removed one.
        """
        removed = set(object_ids)
        return replace(self, objects=tuple(obj for obj in self.objects if obj.id not in removed))

    def with_object(self, obj: HomeObject) -> Home:
        """Return the home with an object added, or replaced if its id exists.

        Args:
            obj: The new object.

        Raises:
            ValueError: Its parent does not exist.
        """
        if obj.id not in self:
            return replace(self, objects=(*self.objects, obj))
        return replace(self, objects=tuple(obj if o.id == obj.id else o for o in self.objects))
