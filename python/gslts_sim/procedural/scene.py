"""A room that is being furnished: collision-free placement of its objects."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from gslts.types import Floats
from gslts_sim.home import AreaLight, Home, HomeObject, Room, pose
from gslts_sim.oriented_boxes import OrientedBoxes, collides
from gslts_sim.physics import boxes_in_world, collision_free, footprint, supported_fraction
from gslts_sim.procedural.catalog import building
from gslts_sim.procedural.catalog.building import Opening
from gslts_sim.procedural.model import Kit, Model
from gslts_sim.procedural.receptacles import top_near
from gslts_sim.procedural.sides import Side, sides

Builder = Callable[..., Model]
Span = tuple[float, float]
MAX_TRIES, BATCH = 24, 6
"""Maximum number of poses that are tried for a small object, and their number at once."""
MIN_SUPPORTED_FRACTION = 0.8
"""Minimum supported fraction of a footprint; more than `physics` asks for."""
GAP_M = 0.1
"""Minimum distance between objects that hang on a wall, m."""
EDGE_M = 0.015
"""Minimum distance of small objects from the edge of their receptacle, m."""


class Scene:
    """A room that is being furnished.

    Args:
        kit: Materials, style and random stream.
        room_type: Such as `kitchen`.
        size: Width (x), depth (y) and height of the room, m.
    """

    def __init__(self, kit: Kit, room_type: str, size: tuple[float, float, float]) -> None:
        self.kit, self.rng = kit, kit.rng
        self.room_type, self.size = room_type, size
        self.sides = sides(size[0], size[1])
        self.objects: list[HomeObject] = []
        self.lights: list[AreaLight] = []
        self._obstacles = OrientedBoxes.concatenate([])
        self._kept_free: list[OrientedBoxes] = []
        self._openings: list[OrientedBoxes] = []

    # Objects.

    def build(self, builder: Builder, *args: float | str) -> HomeObject:
        """Build an object in its own frame; its id is its type until it is added.

        Args:
            builder: Function of the catalogue.
            *args: Passed to `builder`.
        """
        model = builder(self.kit, *args)
        return model.object(model.type, np.eye(4), None)

    def add(self, obj: HomeObject, at: Floats, parent: str | None) -> HomeObject:
        """Add an object without a check, and number it.

        Args:
            obj: The object.
            at: [4,4] float64 world_from_object, m.
            parent: Id of the receptacle that it stands on.
        """
        number = 1 + sum(other.type == obj.type for other in self.objects)
        placed = replace(obj, id=f"{obj.type}|{number}", world_from_object=at, parent=parent)
        self.objects.append(placed)
        self._obstacles = OrientedBoxes.concatenate([self._obstacles, boxes_in_world(placed)])
        return placed

    def undo(self, count: int) -> None:
        """Remove the objects that were added last.

        Args:
            count: Number of objects.
        """
        boxes = sum(len(obj.boxes) for obj in self.objects[-count:])
        del self.objects[-count:]
        self._obstacles = self._obstacles[: len(self._obstacles) - boxes]

    def fits(
        self, boxes: Floats, at: Floats, *, on_floor: bool = False, in_the_way: bool = False
    ) -> bool:
        """Return whether a pose is free.

        Args:
            boxes: [B,2,3] float64, of an object, in its own frame, m.
            at: [4,4] float64 world_from_object, m.
            on_floor: It must be inside the room and off the floor that is kept free.
            in_the_way: It may stand where the floor is kept free, as chairs do.
        """
        oriented = OrientedBoxes.from_object(boxes, at)
        if collides(oriented, self._obstacles):
            return False
        if not on_floor:
            return True
        low, high = oriented.bounds
        inside = (low[:, :2] > 0).all() and (high[:, :2] < self.size[:2]).all()
        if in_the_way or not inside:
            return bool(inside)
        return not any(collides(oriented, kept) for kept in self._kept_free)

    def keep_free(self, x: Span, y: Span) -> None:
        """Keep furniture off a rectangle of the floor.

        Args:
            x: Range, m.
            y: Range, m.
        """
        box = np.array([[[x[0], y[0], 0.03], [x[1], y[1], 2.0]]])
        self._kept_free.append(OrientedBoxes.from_object(box, np.eye(4)))

    def keep_free_at(self, side: Side, along: Span, out: Span) -> None:
        """Keep furniture off a rectangle of the floor at a wall.

        Args:
            side: The wall.
            along: Range from the left corner, m.
            out: Range off the wall, m.
        """
        corners = np.stack([side.point(along[0], out[0]), side.point(along[1], out[1])])
        low, high = corners.min(axis=0), corners.max(axis=0)
        self.keep_free((low[0], high[0]), (low[1], high[1]))

    # The shell.

    def shell(self, openings: dict[int, list[Opening]], accent: int) -> None:
        """Add floor, walls and ceiling.

        Args:
            openings: Holes in the walls, by the number of the wall.
            accent: Number of the wall with the accent material; -1 for none.
        """
        width, depth, height = self.size
        floor = self.build(building.floor, width, depth, self.room_type)
        self.add(floor, pose(width / 2, depth / 2, -building.THICKNESS_M, 0), None)
        for number, side in enumerate(self.sides):
            model = building.wall(
                self.kit, side.length, height, openings.get(number, []), accent=number == accent
            )
            wall = model.object("Wall", np.eye(4), None)
            out = wall.box_in_world[1, 1] - building.THICKNESS_M
            self.add(wall, self._at(side, side.length / 2, out, 0.0), None)
            for hole in openings.get(number, []):
                box = np.array([[[hole.left, -0.1, hole.bottom], [hole.right, 0.1, hole.top]]])
                self._openings.append(OrientedBoxes.from_object(box, self._at(side, 0.0, 0.0, 0.0)))
        ceiling = self.build(building.ceiling, width, depth)
        self.add(ceiling, pose(width / 2, depth / 2, height, 0), None)

    def _at(self, side: Side, along: float, out: float, z: float) -> Floats:
        x, y = side.point(along, out)
        return pose(float(x), float(y), z, side.yaw_rad)

    def hang(
        self,
        obj: HomeObject,
        number: int,
        along: float,
        z: float,
        into_m: float = 0.0,
        margin: float = 0.0,
        *,
        before_opening: bool = False,
    ) -> HomeObject | None:
        """Fix an object to a wall, if there is room.

        Args:
            obj: Object with its back towards +y.
            number: Of the wall.
            along: Of its middle from the left corner, m.
            z: Height of its underside, m.
            into_m: Depth to which it reaches into the wall, m.
            margin: Minimum distance to other objects beside, above and below it, m.
            before_opening: It may hang before a window or a door.

        Returns:
            The object; None if there is no room.
        """
        side = self.sides[number]
        at = self._at(side, along, obj.box_in_world[1, 1] - into_m, z)
        around = np.array([[-margin, 0, -margin], [margin, 0, margin]])
        if not self.fits(obj.boxes + around, at):
            return None
        if into_m == 0 and not before_opening:
            boxes = OrientedBoxes.from_object(obj.boxes, at)
            if any(collides(boxes, opening) for opening in self._openings):
                return None
        return self.add(obj, at, f"Wall|{number + 1}")

    # Furniture.

    def stand(
        self,
        obj: HomeObject,
        number: int,
        along: float,
        gap: float = 0.0,
        front: float = 0.0,
    ) -> HomeObject | None:
        """Place an object against a wall, if there is room.

        Args:
            obj: Object with its back towards +y.
            number: Of the wall.
            along: Of its middle from the left corner, m.
            gap: Between its back and the wall, m, beside the skirting board.
            front: Depth of the floor before it that is kept free, m.

        Returns:
            The object; None if there is no room.
        """
        side = self.sides[number]
        half_width, half_depth = obj.box_in_world[1, :2]
        if along < half_width or along > side.length - half_width:
            return None
        out = half_depth + gap + 0.013
        at = self._at(side, along, out, 0.0)
        if not self.fits(obj.boxes, at, on_floor=True):
            return None
        if front > 0:
            span = (along - half_width, along + half_width)
            self.keep_free_at(side, span, (out + half_depth, out + half_depth + front))
        return self.add(obj, at, "Floor|1")

    def stand_somewhere(
        self,
        obj: HomeObject,
        numbers: list[int],
        gap: float = 0.0,
        front: float = 0.5,
        step: float = 0.1,
    ) -> HomeObject | None:
        """Place an object against the first of some walls that has room, anywhere along it.

        Args:
            obj: Object with its back towards +y.
            numbers: Of the walls, in this order.
            gap: Between its back and the wall, m, beside the skirting board.
            front: Depth of the floor before it that is kept free, m.
            step: Of the positions that are tried, m.

        Returns:
            The object; None if there is no room.
        """
        half_width = float(obj.box_in_world[1, 0])
        for number in numbers:
            free = self.sides[number].length - 2 * half_width
            if free < 0.04:
                continue
            poses = half_width + 0.02 + np.arange(0, free - 0.03, step)
            for along in self.rng.permutation(poses):
                placed = self.stand(obj, number, float(along), gap, front)
                if placed is not None:
                    return placed
        return None

    def stand_at(
        self,
        obj: HomeObject,
        x: float,
        y: float,
        yaw_rad: float,
        parent: str = "Floor|1",
        *,
        in_the_way: bool = False,
    ) -> HomeObject | None:
        """Place an object anywhere on the floor, or on a rug, if there is room.

        Args:
            obj: The object.
            x: m.
            y: m.
            yaw_rad: About the vertical, rad.
            parent: Id of the floor or of the rug.
            in_the_way: It may stand where the floor is kept free, as chairs do.

        Returns:
            The object; None if there is no room.
        """
        at = pose(x, y, self._top(parent), yaw_rad)
        in_the_way = in_the_way or parent != "Floor|1"
        fits = self.fits(obj.boxes, at, on_floor=True, in_the_way=in_the_way)
        return self.add(obj, at, parent) if fits else None

    def _top(self, object_id: str) -> float:
        if object_id == "Floor|1":
            return 0.0
        parent = self[object_id]
        return float(parent.world_from_object[2, 3] + parent.boxes[:, 1, 2].max())

    def __getitem__(self, object_id: str) -> HomeObject:
        return next(obj for obj in self.objects if obj.id == object_id)

    # Small objects.

    def put(
        self,
        obj: HomeObject,
        parent: HomeObject,
        x: Span = (-1, 1),
        y: Span = (-1, 1),
        turn: Span = (-0.3, 0.3),
        near_z: float | None = None,
    ) -> HomeObject | None:
        """Put an object on another one, if there is room.

        Args:
            obj: The object.
            parent: Its receptacle.
            x: Range of positions, from -1 to 1 over the width in which it can move.
            y: Range of positions over the depth; -1 is the front.
            turn: Range of its yaw relative to the parent, rad.
            near_z: Approximate height of the face, in the frame of the parent, m; None for the
                highest.

        Returns:
            The object; None if there is no room.
        """
        top = top_near(parent, np.inf if near_z is None else near_z)
        yaw = float(np.arctan2(parent.world_from_object[1, 0], parent.world_from_object[0, 0]))
        half = obj.box_in_world[1, :2]
        carriers, foot = boxes_in_world(parent), footprint(obj.boxes)[0, :2]
        for _ in range(MAX_TRIES // BATCH):
            angles = self.rng.uniform(*turn, BATCH)
            shares = np.stack([self.rng.uniform(*x, BATCH), self.rng.uniform(*y, BATCH)], axis=1)
            cosine, sine = np.abs(np.cos(angles))[:, None], np.abs(np.sin(angles))[:, None]
            reach = cosine * half + sine * half[::-1]
            room = np.maximum((top[1, :2] - top[0, :2]) / 2 - reach - EDGE_M, 0)
            local = np.ones((BATCH, 4))
            local[:, :2] = top[:, :2].mean(axis=0) + room * shares
            local[:, 2] = top[1, 2]
            # The middle of its footprint comes there, not that of handles and spouts.
            turned = np.stack([np.cos(angles), np.sin(angles)], axis=1)
            local[:, 0] -= turned @ (foot * (1, -1))
            local[:, 1] -= turned @ foot[::-1]
            points = local @ parent.world_from_object[:3].T
            facings = (angles + yaw).tolist()
            poses = np.stack(
                [
                    pose(px, py, pz, facing)
                    for (px, py, pz), facing in zip(points.tolist(), facings, strict=True)
                ]
            )
            good = supported_fraction(obj.boxes, poses, carriers) >= MIN_SUPPORTED_FRACTION
            if good.any():
                poses = poses[good]
                free = collision_free(obj.boxes, poses, self._obstacles)
                if free.any():
                    return self.add(obj, poses[free.argmax()], parent.id)
        return None

    # Light.

    def ceiling_light(self, x: float, y: float, side: float, radiance: Floats) -> None:
        """Add a flat lamp with its light under the ceiling.

        Args:
            x: m.
            y: m.
            side: Edge, m.
            radiance: (3,) float64, linear RGB.
        """
        lamp = self.build(building.ceiling_lamp, side)
        height = self.size[2]
        z = height - float(lamp.box_in_world[1, 2])
        edge = side - 0.06
        light = AreaLight(
            center=np.array([0.0, 0.0, -0.005]),
            edge_u=np.array([0.0, edge, 0.0]),
            edge_v=np.array([edge, 0.0, 0.0]),
            radiance=radiance,
        )
        self.add(replace(lamp, lights=(light,)), pose(x, y, z, 0), "Ceiling|1")

    def home(self, name: str, ambient: Floats) -> Home:
        """Return the finished home.

        Args:
            name: For people.
            ambient: (3,) float64, linear RGB.
        """
        width, depth, height = self.size
        room = Room(self.room_type, np.array([[0.0, 0.0, 0.0], [width, depth, height]]))
        return Home(name, (room,), tuple(self.objects), tuple(self.lights), ambient)
