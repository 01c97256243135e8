"""Changes of a home: what is taken away, brought back or put elsewhere must stand and fit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gslts.types import Floats
from gslts_sim.home import Home, HomeObject, pose, yaw_of
from gslts_sim.physics import (
    MIN_SUPPORTED_FRACTION,
    OrientedBoxes,
    boxes_in_world,
    collides,
    collisions,
    footprint,
    resting_poses,
    stands_on,
    supported_fraction,
)

SNAP_M = (0.1, 0.01)
"""A thing is set down on the highest face at most this far below or above the point it is told."""

FLOOR_VOLUME_M3 = 0.04
"""Things that fill a larger box, such as chairs, stand on the floor only."""

FLOOR_TYPES = ("Floor", "Rug")

PLACES_TRIED = 400
"""Of a thing on a receptacle, at most, so that beds and floors take no longer than shelves."""


class ChangeError(Exception):
    """A change that cannot be, and why."""


@dataclass(frozen=True, eq=False)
class Placement:
    """A place for a thing, as `place` takes it.

    Args:
        position: (3,) m.
        yaw_deg: About the vertical, degrees.
        home: With the thing there.
    """

    position: Floats
    yaw_deg: float
    home: Home


def disable(home: Home, object_id: str) -> Home:
    """The home without an object.

    Raises:
        ChangeError: There is no such object, it belongs to the building, or something stands on
            it.
    """
    thing = _movable(home, object_id)
    return home.without([thing.id])


def enable(home: Home, thing: HomeObject, keep_free: OrientedBoxes | None = None) -> Home:
    """The home with an object back where it last was.

    Args:
        home: Without the object.
        thing: The object, as it was.
        keep_free: Where nothing may be put, such as where the robot is.

    Raises:
        ChangeError: It is there already, what it stood on is gone, or its place is taken.
    """
    if thing.id in home:
        raise ChangeError(f"{thing.id} is there already")
    if thing.parent is None:
        raise ChangeError(f"{thing.id} stood on nothing")
    if thing.parent not in home:
        raise ChangeError(f"{thing.id} stood on {thing.parent}, which is not there")
    if not stands_on(thing, home[thing.parent]):
        raise ChangeError(f"{thing.id} would not stand on {thing.parent} any more")
    _refuse_overlaps(home, thing, keep_free)
    return home.with_object(thing)


def place(
    home: Home,
    object_id: str,
    position: Floats,
    yaw_deg: float | None = None,
    keep_free: OrientedBoxes | None = None,
) -> Home:
    """The home with an object at another place.

    Args:
        home: With the object.
        object_id: Of a movable object on which nothing stands.
        position: (3,) m: where its origin, the middle of the box around its underside, comes; it is
            set down on a level face at most `SNAP_M` away.
        yaw_deg: Its turn about the vertical, degrees; None keeps it.
        keep_free: Where nothing may be put, such as where the robot is.

    Raises:
        ChangeError: There is no such object, it cannot be moved, no face is below, too little of
            it is carried, or it would overlap another object.
    """
    if not np.isfinite(position).all():
        raise ChangeError(f"position {position.tolist()} is not finite")
    thing = _movable(home, object_id)
    x, y, z = position
    at = pose(x, y, z, yaw_of(thing) if yaw_deg is None else float(np.deg2rad(yaw_deg)))
    foot = at @ np.append(footprint(thing.boxes)[0], 1)
    others = [other for other in home.objects if other.id != thing.id]
    tops = [_top_at(other, foot[:3]) for other in others] or [-np.inf]
    best = int(np.argmax(tops))
    if tops[best] == -np.inf:
        raise ChangeError(
            f"there is no level face within {SNAP_M[0]:g} m below ({x:g}, {y:g}, {z:g})"
        )
    at[2, 3] += tops[best] - foot[2]
    parent_id = others[best].id
    share = supported_fraction(thing.boxes, at[None], boxes_in_world(others[best]))[0]
    if share < MIN_SUPPORTED_FRACTION:
        raise ChangeError(
            f"only {100 * share:.0f} % of {thing.id} would stand on {parent_id}, "
            f"{100 * MIN_SUPPORTED_FRACTION:.0f} % must"
        )
    placed = thing.place_at(at, parent_id)
    _refuse_overlaps(home, placed, keep_free)
    return home.with_object(placed)


def spawn_randomly(
    home: Home, seed: int, attempts: int = 5, keep_free: OrientedBoxes | None = None
) -> Home:
    """The home with its movable objects shuffled over all that can carry them.

    Args:
        home: Objects on which others stand stay where they are, until those are gone.
        seed: Same home and seed, same result.
        attempts: Receptacles that are tried for each object; it stays when none has room.
        keep_free: Where nothing may be put, such as where the robot is.
    """
    rng = np.random.default_rng(seed)
    ids = [thing.id for thing in home.objects if thing.movable]
    for object_id in rng.permutation(ids):
        thing = home[str(object_id)]
        if any(other.parent == thing.id for other in home.objects):
            continue
        receptacles = possible_receptacles(home, thing)
        for index in rng.permutation(len(receptacles))[:attempts]:
            drawn = draw_place(home, thing, receptacles[index], rng, keep_free)
            if drawn is not None:
                home = drawn.home
                break
    return home


def possible_receptacles(home: Home, thing: HomeObject) -> list[HomeObject]:
    """What a thing may be put on, in the order of the home: the floor alone if it is large."""
    large = float(np.prod(np.ptp(thing.boxes.reshape(-1, 3), axis=0))) > FLOOR_VOLUME_M3
    return [
        other
        for other in home.objects
        if other.receptacle and other.id != thing.id and (other.type in FLOOR_TYPES or not large)
    ]


def draw_place(
    home: Home,
    thing: HomeObject,
    receptacle: HomeObject,
    rng: np.random.Generator,
    keep_free: OrientedBoxes | None = None,
) -> Placement | None:
    """A place by chance of a thing on a receptacle; None where it has no room."""
    low, high = receptacle.box_in_world
    spacing_m = max(0.05, float(np.sqrt(np.prod((high - low)[:2]) / PLACES_TRIED)))
    # Rounded as a script writes it, so that what is replayed is what was drawn.
    yaw_deg = float(rng.integers(-180, 180))
    turn_rad = np.deg2rad(yaw_deg) - yaw_of(receptacle)
    places = resting_poses(home, thing, receptacle, turn_rad, spacing_m)
    if len(places) == 0:
        return None
    position = np.round(places[rng.integers(len(places)), :3, 3], 3)
    try:
        changed = place(home, thing.id, position, yaw_deg, keep_free)
    except ChangeError:
        return None
    return Placement(position, yaw_deg, changed)


def _movable(home: Home, object_id: str) -> HomeObject:
    """The object, if it can be taken away."""
    if object_id not in home:
        raise ChangeError(f"there is no {object_id}")
    thing = home[object_id]
    if not thing.movable:
        raise ChangeError(f"{object_id} is not movable")
    carried = [other.id for other in home.objects if other.parent == object_id]
    if carried:
        raise ChangeError(f"{carried[0]} stands on {object_id}")
    return thing


def _top_at(thing: HomeObject, position: Floats) -> float:
    """Height of the highest face of a thing at a point, within `SNAP_M` of it; -inf if none."""
    boxes = boxes_in_world(thing)
    local = np.einsum("nji,nj->ni", boxes.axes, position - boxes.centers)
    tops = boxes.centers[:, 2] + boxes.halves[:, 2]
    carries = (np.abs(local[:, :2]) <= boxes.halves[:, :2]).all(axis=1)
    carries &= boxes.axes[:, 2, 2] > 1 - 1e-6
    carries &= (tops >= position[2] - SNAP_M[0]) & (tops <= position[2] + SNAP_M[1])
    return float(tops[carries].max(initial=-np.inf))


def _refuse_overlaps(home: Home, thing: HomeObject, keep_free: OrientedBoxes | None) -> None:
    if keep_free is not None and collides(boxes_in_world(thing), keep_free):
        raise ChangeError("the robot stands in the way")
    hit = collisions(home, thing)
    if hit:
        raise ChangeError(f"{thing.id} would overlap {hit[0]}")
