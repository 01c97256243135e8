"""Collision and support tests of the objects of a home.

An object stands on a face when its base is within `SUPPORT_M` of it.
"""

from __future__ import annotations

import numpy as np

from gslts.types import Bools, Floats, Ints
from gslts_sim.home import Home, HomeObject
from gslts_sim.oriented_boxes import OrientedBoxes, colliding_pairs, overlap_m

SUPPORT_M = 0.003
"""Maximum gap between a base and the face that carries it, m."""
MIN_SUPPORTED_FRACTION = 0.6
"""Minimum fraction of the footprint that must lie on the face below."""
FOOTPRINT_STEPS = 9
"""Number of sample points of a footprint in each direction; support is known to about 1/81."""


def boxes_in_world(obj: HomeObject) -> OrientedBoxes:
    """Return the boxes that an object fills, in the world.

    Args:
        obj: The object.
    """
    return OrientedBoxes.from_object(obj.boxes, obj.world_from_object)


def collisions(home: Home, obj: HomeObject) -> list[str]:
    """Find the objects of a home that an object collides with.

    Args:
        home: May hold the object itself, at any pose; that is ignored.
        obj: The object.

    Returns:
        Ids.
    """
    others = [other for other in home.objects if other.id != obj.id]
    every, owner = _boxes_with_owners(others)
    pairs = colliding_pairs(boxes_in_world(obj), every)
    return [others[i].id for i in np.unique(owner[pairs[:, 1]])]


def _boxes_with_owners(objs: list[HomeObject]) -> tuple[OrientedBoxes, Ints]:
    """Return the boxes of several objects, and for each box the index of its object."""
    several = [boxes_in_world(obj) for obj in objs]
    owner = np.repeat(np.arange(len(objs)), [len(boxes) for boxes in several])
    return OrientedBoxes.concatenate(several), owner


def footprint(boxes: Floats) -> Floats:
    """Sample the footprint of an upright object.

    Args:
        boxes: [B,2,3] float64, m, in its own frame.

    Returns:
        [K,3] float64, m: points that fill the rectangle around those of its boxes that reach down
        to its underside; the middle first.
    """
    base = boxes[:, 0, 2].min()
    standing = boxes[boxes[:, 0, 2] < base + SUPPORT_M]
    low, high = standing[:, 0, :2].min(axis=0), standing[:, 1, :2].max(axis=0)
    # Half a step inside the edge, so that the fraction of points is the fraction of area.
    steps = (np.arange(FOOTPRINT_STEPS) + 0.5) / FOOTPRINT_STEPS
    points = np.full((1 + FOOTPRINT_STEPS**2, 3), base)
    points[0, :2] = (low + high) / 2
    points[1:, 0] = np.repeat(low[0] + steps * (high[0] - low[0]), FOOTPRINT_STEPS)
    points[1:, 1] = np.tile(low[1] + steps * (high[1] - low[1]), FOOTPRINT_STEPS)
    return points


def supported_fraction(boxes: Floats, poses: Floats, parent: OrientedBoxes) -> Floats:
    """Compute the fraction of an object's footprint that a parent supports, at several poses.

    Args:
        boxes: [B,2,3] float64, m, of the object, in its own frame.
        poses: [P,4,4] float64 world_from_object, m.
        parent: Boxes of the receptacle; those whose top is not level support nothing.

    Returns:
        [P] float64 from 0 to 1; 0 where the middle of the footprint is not supported.
    """
    level = parent[parent.axes[:, 2, 2] > 1 - 1e-6]
    tops = level.centers[:, 2] + level.halves[:, 2]
    points = footprint(boxes) @ poses[:, :3, :3].transpose(0, 2, 1) + poses[:, None, :3, 3]
    offsets = points[None, :, :, :2] - level.centers[:, None, None, :2]
    local = offsets @ level.axes[:, None, :2, :2]
    inside = np.all(np.abs(local) <= level.halves[:, None, None, :2] + 1e-6, axis=3)
    inside &= (np.abs(points[None, :, 0, 2] - tops[:, None]) <= SUPPORT_M)[:, :, None]
    carried = np.any(inside, axis=0)
    fractions: Floats = carried[:, 1:].mean(axis=1) * carried[:, 0]
    return fractions


def collision_free(boxes: Floats, poses: Floats, obstacles: OrientedBoxes) -> Bools:
    """Test at which of several poses an object collides with nothing.

    Args:
        boxes: [B,2,3] float64, m, in the object's own frame.
        poses: [P,4,4] float64 world_from_object, m.
        obstacles: Boxes of all other objects.

    Returns:
        [P] bool.
    """
    pairs = colliding_pairs(OrientedBoxes.from_object(boxes, poses), obstacles)
    free = np.ones(len(poses), np.bool_)
    free[pairs[:, 0] // len(boxes)] = False
    return free


def stands_on(obj: HomeObject, parent: HomeObject) -> bool:
    """Return whether an object stands on another one.

    Args:
        obj: The middle and most of its footprint must be supported.
        parent: The other object.
    """
    fraction = supported_fraction(obj.boxes, obj.world_from_object[None], boxes_in_world(parent))
    return bool(fraction[0] >= MIN_SUPPORTED_FRACTION)


def hangs_on(obj: HomeObject, parent: HomeObject) -> bool:
    """Return whether an object touches another one from any side, as fixed objects do.

    Args:
        obj: The object.
        parent: The other object.
    """
    own, other = boxes_in_world(obj), boxes_in_world(parent)
    first, second = (
        index.ravel() for index in np.meshgrid(np.arange(len(own)), np.arange(len(other)))
    )
    return bool((overlap_m(own[first], other[second]) > -SUPPORT_M).any())


def support_below(home: Home, obj: HomeObject) -> str | None:
    """Find the object that an object stands on.

    Args:
        home: With all objects.
        obj: The object.

    Returns:
        Id of the one that supports most of it; None if there is none.
    """
    others = [other for other in home.objects if other.id != obj.id]
    at = obj.world_from_object[None]
    fractions = [supported_fraction(obj.boxes, at, boxes_in_world(other))[0] for other in others]
    best = int(np.argmax(fractions)) if fractions else 0
    return others[best].id if fractions and fractions[best] >= MIN_SUPPORTED_FRACTION else None


def resting_poses(
    home: Home,
    obj: HomeObject,
    receptacle: HomeObject,
    yaw_rad: float = 0.0,
    spacing_m: float = 0.05,
) -> Floats:
    """Find collision-free poses of an object on a receptacle.

    Args:
        home: With the receptacle; may hold the object itself, which is ignored.
        obj: The object.
        receptacle: Object that it is put on.
        yaw_rad: Yaw of the object relative to the receptacle, rad.
        spacing_m: Of the grid of positions that are tried, m.

    Returns:
        [P,4,4] float64 world_from_object, m, from the lowest top face to the highest.
    """
    cosine, sine = np.cos(yaw_rad), np.sin(yaw_rad)
    points = np.concatenate([_grid(top, spacing_m) for top in _tops(receptacle.boxes)])
    poses = np.tile(np.eye(4), (len(points), 1, 1))
    poses[:, :2, :2] = [[cosine, -sine], [sine, cosine]]
    poses[:, :3, 3] = points
    poses = receptacle.world_from_object @ poses
    carried = (
        supported_fraction(obj.boxes, poses, boxes_in_world(receptacle)) >= MIN_SUPPORTED_FRACTION
    )
    poses = poses[carried]
    obstacles, _ = _boxes_with_owners([other for other in home.objects if other.id != obj.id])
    return poses[collision_free(obj.boxes, poses, obstacles)]


def _tops(boxes: Floats) -> list[Floats]:
    """Return for each height at which boxes [B,2,3] end the box [2,3] around those."""
    tops = []
    for height in np.unique(boxes[:, 1, 2]):
        ending = boxes[boxes[:, 1, 2] == height]
        tops.append(np.stack([ending[:, 0].min(axis=0), ending[:, 1].max(axis=0)]))
    return tops


def _grid(top: Floats, spacing_m: float) -> Floats:
    """Return grid points [K,3] on the upper face of a box [2,3]."""
    size = top[1] - top[0]
    counts = np.maximum(1, np.floor(size[:2] / spacing_m)).astype(int)
    x, y = (top[0, k] + (np.arange(counts[k]) + 0.5) * size[k] / counts[k] for k in range(2))
    columns, rows = np.meshgrid(x, y)
    return np.stack([columns, rows, np.full_like(columns, top[1, 2])], axis=-1).reshape(-1, 3)


def problems(home: Home) -> list[str]:
    """Check a home: movable objects stand on their parents, fixed ones may hang, none overlap.

    Args:
        home: The home.

    Returns:
        One message for each problem.
    """
    found = []
    for obj in home.objects:
        if obj.parent is None:
            if obj.movable:
                found.append(f"{obj.id} is movable and stands on nothing")
            continue
        parent = home[obj.parent]
        if stands_on(obj, parent) or (not obj.movable and hangs_on(obj, parent)):
            continue
        found.append(f"{obj.id} does not rest on {parent.id}")
    every, owner = _boxes_with_owners(list(home.objects))
    pairs = colliding_pairs(every, every)
    owners = np.unique(owner[pairs[owner[pairs[:, 0]] < owner[pairs[:, 1]]]], axis=0)
    found += [f"{home.objects[i].id} overlaps {home.objects[j].id}" for i, j in owners]
    return found
