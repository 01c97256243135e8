"""Removals, returns, moves and shifts of objects: the result is stable and free of collisions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gslts.types import Floats
from gslts_sim.home import Home, HomeObject, pose, yaw_of
from gslts_sim.oriented_boxes import OrientedBoxes, collides
from gslts_sim.physics import (
    MIN_SUPPORTED_FRACTION,
    boxes_in_world,
    collisions,
    footprint,
    resting_poses,
    stands_on,
    supported_fraction,
)

SNAP_M = (0.1, 0.01)
"""An object is put on the highest level face at most this far below, or above, the position that is
asked for, m: positions need not be exact, and nothing falls far."""
MAX_CARRIED_VOLUME_M3 = 0.04
"""Objects with a larger bounding box, such as chairs, stand on the floor only, m^3."""
FLOOR_TYPES = ("Floor", "Rug")
"""Types of receptacles that carry objects of any size."""
MAX_POSES_TRIED = 400
"""Approximate maximum number of poses that are tried on a receptacle: bounds the time on large ones
such as beds and floors."""
MAX_SHIFT_M, MAX_SHIFT_DEG = 0.15, 15.0
"""Maximum distance and turn of a shift: what is pushed farther is somewhere else."""


class ChangeError(Exception):
    """An impossible change; the message says why."""


@dataclass(frozen=True, eq=False)
class Placement:
    """A sampled pose of an object on a receptacle.

    Args:
        position: (3,) in the world, m, as `place` takes it.
        yaw_deg: About the vertical, degrees.
        home: The home with the object there.
    """

    position: Floats
    yaw_deg: float
    home: Home


def disable(home: Home, object_id: str) -> Home:
    """Remove an object.

    Args:
        home: With the object.
        object_id: Id of a movable object on which nothing stands.

    Returns:
        The home without it.

    Raises:
        ChangeError: The object does not exist, is not movable, or carries another object.
    """
    return home.without([_movable_object(home, object_id).id])


def enable(home: Home, obj: HomeObject, keep_free: OrientedBoxes | None = None) -> Home:
    """Return a removed object to its last pose.

    Args:
        home: Without the object.
        obj: The object at its last pose.
        keep_free: Boxes that must stay free, such as the robot's body.

    Returns:
        The home with it.

    Raises:
        ChangeError: It is there already, its receptacle is gone, or its pose is not free.
    """
    if obj.id in home:
        raise ChangeError(f"{obj.id} is there already")
    if obj.parent is None:
        raise ChangeError(f"{obj.id} stood on nothing")
    if obj.parent not in home:
        raise ChangeError(f"{obj.id} stood on {obj.parent}, which is not there")
    if not stands_on(obj, home[obj.parent]):
        raise ChangeError(f"{obj.id} would not stand on {obj.parent} any more")
    _require_free(home, obj, keep_free)
    return home.with_object(obj)


def place(
    home: Home,
    object_id: str,
    position: Floats,
    yaw_deg: float | None = None,
    keep_free: OrientedBoxes | None = None,
) -> Home:
    """Move an object.

    Args:
        home: With the object.
        object_id: Id of a movable object on which nothing stands.
        position: (3,) of its origin, the middle of its underside, in the world, m; the object is
            put on a level face at most `SNAP_M` away.
        yaw_deg: Its new yaw, degrees; None keeps the current one.
        keep_free: Boxes that must stay free, such as the robot's body.

    Returns:
        The home with the object there.

    Raises:
        ChangeError: The object does not exist or is not movable, there is no level face, too little
            of the object is supported, or it would overlap another object.
    """
    if not np.isfinite(position).all():
        raise ChangeError(f"position {position.tolist()} is not finite")
    obj = _movable_object(home, object_id)
    x, y, z = position
    at = pose(x, y, z, yaw_of(obj) if yaw_deg is None else float(np.deg2rad(yaw_deg)))
    foot = at @ np.append(footprint(obj.boxes)[0], 1)
    others = [other for other in home.objects if other.id != obj.id]
    tops = [_support_height(other, foot[:3]) for other in others] or [-np.inf]
    best = int(np.argmax(tops))
    if tops[best] == -np.inf:
        raise ChangeError(
            f"there is no level face within {SNAP_M[0]:g} m below ({x:g}, {y:g}, {z:g})"
        )
    at[2, 3] += tops[best] - foot[2]
    parent_id = others[best].id
    fraction = supported_fraction(obj.boxes, at[None], boxes_in_world(others[best]))[0]
    if fraction < MIN_SUPPORTED_FRACTION:
        raise ChangeError(
            f"only {100 * fraction:.0f} % of {obj.id} would stand on {parent_id}, "
            f"{100 * MIN_SUPPORTED_FRACTION:.0f} % must"
        )
    placed = obj.place_at(at, parent_id)
    _require_free(home, placed, keep_free)
    return home.with_object(placed)


def shift(
    home: Home,
    object_id: str,
    dx_m: float,
    dy_m: float,
    yaw_deg: float = 0.0,
    keep_free: OrientedBoxes | None = None,
) -> Home:
    """Push an object a little, with all that stands on it.

    Args:
        home: With the object.
        object_id: Id of a movable object, or of furniture that stands on the floor.
        dx_m: Shift of its origin along x of the world, m.
        dy_m: Shift of its origin along y of the world, m.
        yaw_deg: Turn about the vertical through its origin, degrees.
        keep_free: Boxes that must stay free, such as the robot's body.

    Returns:
        The home after the push; each object still stands on the same one.

    Raises:
        ChangeError: The object does not exist or is fixed, the shift is not finite or too large,
            too little of the object would be supported, or something would overlap another object.
    """
    if not np.isfinite([dx_m, dy_m, yaw_deg]).all():
        raise ChangeError(f"a shift by ({dx_m}, {dy_m}) m and {yaw_deg} degrees is not finite")
    if np.hypot(dx_m, dy_m) > MAX_SHIFT_M or abs(yaw_deg) > MAX_SHIFT_DEG:
        raise ChangeError(
            f"a shift by ({dx_m:g}, {dy_m:g}) m and {yaw_deg:g} degrees is too large: "
            f"at most {MAX_SHIFT_M:g} m and {MAX_SHIFT_DEG:g} degrees"
        )
    obj, parent = _standing_object(home, object_id)
    x, y, z = obj.world_from_object[:3, 3]
    motion = pose(x + dx_m, y + dy_m, z, float(np.deg2rad(yaw_deg)))
    motion = motion @ np.linalg.inv(pose(x, y, z, 0.0))
    pushed = [
        each.place_at(motion @ each.world_from_object, each.parent)
        for each in with_carried(home, obj)
    ]
    if not stands_on(pushed[0], parent):
        raise ChangeError(f"{object_id} would not stand on {parent.id} any more")
    others = home.without([each.id for each in pushed])
    for each in pushed:
        _require_free(others, each, keep_free)
        home = home.with_object(each)
    return home


def with_carried(home: Home, obj: HomeObject) -> list[HomeObject]:
    """Return an object and all that stands on it, directly or on what it carries.

    Args:
        home: With the object.
        obj: The object; the first of the result.
    """
    carried = [other for other in home.objects if other.parent == obj.id]
    return [obj, *(each for other in carried for each in with_carried(home, other))]


def spawn_randomly(
    home: Home, seed: int, attempts: int = 5, keep_free: OrientedBoxes | None = None
) -> Home:
    """Shuffle the movable objects over the receptacles that can carry them.

    Args:
        home: Objects that carry others stay where they are.
        seed: Same home and seed, same result.
        attempts: Number of receptacles that are tried for each object; it stays if none has room.
        keep_free: Boxes that must stay free, such as the robot's body.

    Returns:
        The home after all moves.
    """
    rng = np.random.default_rng(seed)
    ids = [obj.id for obj in home.objects if obj.movable]
    for object_id in rng.permutation(ids):
        obj = home[str(object_id)]
        if any(other.parent == obj.id for other in home.objects):
            continue
        receptacles = possible_receptacles(home, obj)
        for index in rng.permutation(len(receptacles))[:attempts]:
            drawn = draw_place(home, obj, receptacles[index], rng, keep_free)
            if drawn is not None:
                home = drawn.home
                break
    return home


def possible_receptacles(home: Home, obj: HomeObject) -> list[HomeObject]:
    """Return the receptacles that an object may be put on; only the floor for large objects.

    Args:
        home: With the object.
        obj: The object.

    Returns:
        Objects in the order of the home.
    """
    large = float(np.prod(np.ptp(obj.boxes.reshape(-1, 3), axis=0))) > MAX_CARRIED_VOLUME_M3
    return [
        other
        for other in home.objects
        if other.receptacle and other.id != obj.id and (other.type in FLOOR_TYPES or not large)
    ]


def draw_place(
    home: Home,
    obj: HomeObject,
    receptacle: HomeObject,
    rng: np.random.Generator,
    keep_free: OrientedBoxes | None = None,
) -> Placement | None:
    """Sample a pose of an object on a receptacle.

    Args:
        home: With the object.
        obj: The object.
        receptacle: Object that it is put on.
        rng: Source of randomness.
        keep_free: Boxes that must stay free, such as the robot's body.

    Returns:
        The placement; None if there is no room.
    """
    low, high = receptacle.box_in_world
    spacing_m = max(0.05, float(np.sqrt(np.prod((high - low)[:2]) / MAX_POSES_TRIED)))
    # Rounded as in a script, so that a replay gives the same home.
    yaw_deg = float(rng.integers(-180, 180))
    turn_rad = np.deg2rad(yaw_deg) - yaw_of(receptacle)
    poses = resting_poses(home, obj, receptacle, turn_rad, spacing_m)
    if len(poses) == 0:
        return None
    position = np.round(poses[rng.integers(len(poses)), :3, 3], 3)
    try:
        changed = place(home, obj.id, position, yaw_deg, keep_free)
    except ChangeError:
        return None
    return Placement(position, yaw_deg, changed)


def _movable_object(home: Home, object_id: str) -> HomeObject:
    """Return an object that can be moved, or raise ChangeError."""
    if object_id not in home:
        raise ChangeError(f"there is no {object_id}")
    obj = home[object_id]
    if not obj.movable:
        raise ChangeError(f"{object_id} is not movable")
    carried = [other.id for other in home.objects if other.parent == object_id]
    if carried:
        raise ChangeError(f"{carried[0]} stands on {object_id}")
    return obj


def _standing_object(home: Home, object_id: str) -> tuple[HomeObject, HomeObject]:
    """Return an object that can be pushed and its parent, or raise ChangeError."""
    if object_id not in home:
        raise ChangeError(f"there is no {object_id}")
    obj = home[object_id]
    parent = None if obj.parent is None else home[obj.parent]
    if parent is None or not (obj.movable or parent.type in FLOOR_TYPES):
        raise ChangeError(f"{object_id} is fixed")
    return obj, parent


def _support_height(obj: HomeObject, position: Floats) -> float:
    """Return the height of the highest face at a point (3,), within `SNAP_M`; -inf if none."""
    boxes = boxes_in_world(obj)
    local = np.einsum("nji,nj->ni", boxes.axes, position - boxes.centers)
    tops = boxes.centers[:, 2] + boxes.halves[:, 2]
    carries = (np.abs(local[:, :2]) <= boxes.halves[:, :2]).all(axis=1)
    carries &= boxes.axes[:, 2, 2] > 1 - 1e-6
    carries &= (tops >= position[2] - SNAP_M[0]) & (tops <= position[2] + SNAP_M[1])
    return float(tops[carries].max(initial=-np.inf))


def _require_free(home: Home, obj: HomeObject, keep_free: OrientedBoxes | None) -> None:
    """Raise ChangeError if an object would overlap another one or the boxes kept free."""
    if keep_free is not None and collides(boxes_in_world(obj), keep_free):
        raise ChangeError("the robot stands in the way")
    hit = collisions(home, obj)
    if hit:
        raise ChangeError(f"{obj.id} would overlap {hit[0]}")
