"""What collides, what rests on what, and where there is room: with oriented boxes.

Boxes touch when they overlap by less than `CONTACT_M`; a thing stands on a face when its base is
within `SUPPORT_M` of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gslts.types import Bools, Floats
from gslts_sim.home import Home, HomeObject

CONTACT_M = 0.002
"""Deeper overlaps are collisions: twice what rounded edges and lying cloth take up."""

SUPPORT_M = 0.003
"""Greatest gap between a base and what carries it."""

MIN_SUPPORTED_FRACTION = 0.6
"""Share of the footprint that must lie on the face below."""


@dataclass(frozen=True, eq=False)
class OrientedBoxes:
    """Boxes that may be turned.

    Args:
        centers: [N,3] float64, m.
        halves: [N,3] float64, half of each edge, m.
        axes: [N,3,3] float64; the columns are the directions of the edges.
    """

    centers: Floats
    halves: Floats
    axes: Floats

    def __len__(self) -> int:
        return len(self.centers)

    @classmethod
    def of(cls, boxes: Floats, world_from_object: Floats) -> OrientedBoxes:
        """Boxes of an object's frame, in the world.

        Args:
            boxes: [B,2,3] float64, m.
            world_from_object: [4,4] or [P,4,4] float64: for P places there are P * B boxes, those
                of one place side by side.
        """
        poses = world_from_object.reshape(-1, 4, 4)
        rotations = poses[:, :3, :3]
        middles, halves = (boxes[:, 0] + boxes[:, 1]) / 2, (boxes[:, 1] - boxes[:, 0]) / 2
        centers = middles @ rotations.transpose(0, 2, 1) + poses[:, None, :3, 3]
        return cls(
            centers=centers.reshape(-1, 3),
            halves=np.tile(halves, (len(poses), 1)),
            axes=np.repeat(rotations, len(boxes), axis=0),
        )

    @classmethod
    def joined(cls, several: list[OrientedBoxes]) -> OrientedBoxes:
        """All of several sets."""
        several = [OrientedBoxes.of(np.zeros((0, 2, 3)), np.eye(4)), *several]
        return cls(
            np.concatenate([boxes.centers for boxes in several]),
            np.concatenate([boxes.halves for boxes in several]),
            np.concatenate([boxes.axes for boxes in several]),
        )

    def __getitem__(self, rows: NDArray[np.intp] | Bools | slice) -> OrientedBoxes:
        return OrientedBoxes(self.centers[rows], self.halves[rows], self.axes[rows])

    @cached_property
    def bounds(self) -> tuple[Floats, Floats]:
        """Lower and upper corners [N,3] of the axis-aligned boxes around them, m."""
        reach = (np.abs(self.axes) * self.halves[:, None, :]).sum(axis=2)
        return self.centers - reach, self.centers + reach


def boxes_in_world(thing: HomeObject) -> OrientedBoxes:
    """The boxes that an object fills, in the world."""
    return OrientedBoxes.of(thing.boxes, thing.world_from_object)


def overlap_m(first: OrientedBoxes, second: OrientedBoxes) -> Floats:
    """How deep box i of one set reaches into box i of the other.

    Args:
        first: N boxes.
        second: N boxes.

    Returns:
        [N] float64, m: the shortest shift that parts them; negative where a gap of at least that
        width lies between them.

    Source: separating axes of two boxes, Gottschalk et al. 1996, OBBTree.
    """
    a, b = first.halves, second.halves
    # The axes of the second box and the way to its middle, in the frame of the first.
    turn = first.axes.transpose(0, 2, 1) @ second.axes
    way = np.einsum("nki,nk->ni", first.axes, second.centers - first.centers)
    size = np.abs(turn)
    of_first = a + np.einsum("nij,nj->ni", size, b) - np.abs(way)
    of_second = b + np.einsum("nij,ni->nj", size, a) - np.abs(np.einsum("nij,ni->nj", turn, way))
    one, two = [1, 2, 0], [2, 0, 1]
    reach = a[:, one, None] * size[:, two] + a[:, two, None] * size[:, one]
    reach += b[:, None, one] * size[:, :, two] + b[:, None, two] * size[:, :, one]
    between = np.abs(way[:, two, None] * turn[:, one] - way[:, one, None] * turn[:, two])
    lengths = np.sqrt(np.maximum(1 - turn * turn, 0))
    # Edges that are parallel span no plane; the normals of the faces tell all then.
    spans = lengths > 1e-4
    of_edges = np.where(spans, (reach - between) / np.where(spans, lengths, 1), np.inf)
    depths = [of_first, of_second, of_edges.reshape(-1, 9)]
    depth: Floats = np.concatenate(depths, axis=1).min(axis=1)
    return depth


def colliding_pairs(
    first: OrientedBoxes, second: OrientedBoxes, contact_m: float = CONTACT_M
) -> NDArray[np.intp]:
    """Indices [P,2] of the boxes of two sets that overlap by more than `contact_m`."""
    lower, upper = first.bounds
    other_lower, other_upper = second.bounds
    if len(first) == 0:
        return np.zeros((0, 2), np.intp)
    # The whole of the first set rules most of the second out.
    maybe = (other_upper > lower.min(axis=0) + contact_m).all(axis=1)
    maybe &= (other_lower < upper.max(axis=0) - contact_m).all(axis=1)
    rows = np.flatnonzero(maybe)
    near = (lower[:, None] + contact_m < other_upper[None, rows]).all(axis=2)
    near &= (other_lower[None, rows] + contact_m < upper[:, None]).all(axis=2)
    pairs = np.argwhere(near)
    pairs[:, 1] = rows[pairs[:, 1]]
    if len(pairs) == 0:
        return pairs
    depth = overlap_m(first[pairs[:, 0]], second[pairs[:, 1]])
    return pairs[depth > contact_m]


def collides(first: OrientedBoxes, second: OrientedBoxes, contact_m: float = CONTACT_M) -> bool:
    """Whether any box of one set overlaps any of the other by more than `contact_m`."""
    return len(colliding_pairs(first, second, contact_m)) > 0


def collisions(home: Home, thing: HomeObject) -> list[str]:
    """Ids of the objects of a home, other than this one itself, that an object collides with."""
    others = [other for other in home.objects if other.id != thing.id]
    every, owner = _joined(others)
    pairs = colliding_pairs(boxes_in_world(thing), every)
    return [others[i].id for i in np.unique(owner[pairs[:, 1]])]


def _joined(things: list[HomeObject]) -> tuple[OrientedBoxes, NDArray[np.intp]]:
    """The boxes of several objects, and for each box the index of its object."""
    several = [boxes_in_world(thing) for thing in things]
    owner = np.repeat(np.arange(len(things)), [len(boxes) for boxes in several])
    return OrientedBoxes.joined(several), owner


FOOTPRINT_STEPS = 9
"""The footprint is looked at in as many points each way."""


def footprint(boxes: Floats) -> Floats:
    """What an upright object stands on, seen from above.

    Args:
        boxes: [B,2,3] float64, m, in its own frame.

    Returns:
        [K,3] float64, m: points that fill the rectangle around those of its boxes that reach down
        to its underside; the middle first.
    """
    base = boxes[:, 0, 2].min()
    standing = boxes[boxes[:, 0, 2] < base + SUPPORT_M]
    low, high = standing[:, 0, :2].min(axis=0), standing[:, 1, :2].max(axis=0)
    # Half a step inside the edge, so that the share of points is the share of area.
    steps = (np.arange(FOOTPRINT_STEPS) + 0.5) / FOOTPRINT_STEPS
    points = np.full((1 + FOOTPRINT_STEPS**2, 3), base)
    points[0, :2] = (low + high) / 2
    points[1:, 0] = np.repeat(low[0] + steps * (high[0] - low[0]), FOOTPRINT_STEPS)
    points[1:, 1] = np.tile(low[1] + steps * (high[1] - low[1]), FOOTPRINT_STEPS)
    return points


def supported_fraction(boxes: Floats, places: Floats, parent: OrientedBoxes) -> Floats:
    """How much of an object's footprint upward faces carry, at several places.

    Args:
        boxes: [B,2,3] float64, m: of the object that stands, in its own frame.
        places: [P,4,4] float64: its `world_from_object`.
        parent: Boxes of what it stands on; those whose top is not level carry nothing.

    Returns:
        [P] float64: share of the footprint; 0 where its middle is not carried.
    """
    level = parent[parent.axes[:, 2, 2] > 1 - 1e-6]
    tops = level.centers[:, 2] + level.halves[:, 2]
    points = footprint(boxes) @ places[:, :3, :3].transpose(0, 2, 1) + places[:, None, :3, 3]
    offsets = points[None, :, :, :2] - level.centers[:, None, None, :2]
    local = offsets @ level.axes[:, None, :2, :2]
    inside = np.all(np.abs(local) <= level.halves[:, None, None, :2] + 1e-6, axis=3)
    inside &= (np.abs(points[None, :, 0, 2] - tops[:, None]) <= SUPPORT_M)[:, :, None]
    carried = np.any(inside, axis=0)
    shares: Floats = carried[:, 1:].mean(axis=1) * carried[:, 0]
    return shares


def collision_free(boxes: Floats, places: Floats, obstacles: OrientedBoxes) -> Bools:
    """At which of several places an object collides with nothing.

    Args:
        boxes: [B,2,3] float64, m, in the object's own frame.
        places: [P,4,4] float64: its `world_from_object`.
        obstacles: What stands there already.

    Returns:
        [P] bool.
    """
    pairs = colliding_pairs(OrientedBoxes.of(boxes, places), obstacles)
    free = np.ones(len(places), np.bool_)
    free[pairs[:, 0] // len(boxes)] = False
    return free


def stands_on(thing: HomeObject, parent: HomeObject) -> bool:
    """Whether an object stands on another: its middle and most of its footprint are carried."""
    share = supported_fraction(thing.boxes, thing.world_from_object[None], boxes_in_world(parent))
    return bool(share[0] >= MIN_SUPPORTED_FRACTION)


def hangs_on(thing: HomeObject, parent: HomeObject) -> bool:
    """Whether an object touches another from the side or from below, as what is fixed does."""
    own, other = boxes_in_world(thing), boxes_in_world(parent)
    first, second = (
        index.ravel() for index in np.meshgrid(np.arange(len(own)), np.arange(len(other)))
    )
    return bool((overlap_m(own[first], other[second]) > -SUPPORT_M).any())


def support_below(home: Home, thing: HomeObject) -> str | None:
    """Id of the object that an object stands on; None if it stands on nothing."""
    others = [other for other in home.objects if other.id != thing.id]
    at = thing.world_from_object[None]
    shares = [supported_fraction(thing.boxes, at, boxes_in_world(other))[0] for other in others]
    best = int(np.argmax(shares)) if shares else 0
    return others[best].id if shares and shares[best] >= MIN_SUPPORTED_FRACTION else None


def resting_poses(
    home: Home,
    thing: HomeObject,
    receptacle: HomeObject,
    yaw_rad: float = 0.0,
    spacing_m: float = 0.05,
) -> Floats:
    """Where a thing could stand on a receptacle without touching anything else.

    Args:
        home: With the receptacle; the thing itself may be elsewhere in it, and is ignored there.
        thing: What is to stand.
        receptacle: What it is to stand on.
        yaw_rad: Turn of the thing against the receptacle, about the vertical.
        spacing_m: Of the grid of places that are tried.

    Returns:
        [P,4,4] float64: `world_from_object` of each place; from the lowest top to the highest.
    """
    cosine, sine = np.cos(yaw_rad), np.sin(yaw_rad)
    points = np.concatenate([_grid(top, spacing_m) for top in _tops(receptacle.boxes)])
    places = np.tile(np.eye(4), (len(points), 1, 1))
    places[:, :2, :2] = [[cosine, -sine], [sine, cosine]]
    places[:, :3, 3] = points
    places = receptacle.world_from_object @ places
    carried = (
        supported_fraction(thing.boxes, places, boxes_in_world(receptacle))
        >= MIN_SUPPORTED_FRACTION
    )
    places = places[carried]
    obstacles, _ = _joined([other for other in home.objects if other.id != thing.id])
    return places[collision_free(thing.boxes, places, obstacles)]


def _tops(boxes: Floats) -> list[Floats]:
    """For each height at which boxes [B,2,3] end, the box [2,3] around those that end there."""
    tops = []
    for height in np.unique(boxes[:, 1, 2]):
        ending = boxes[boxes[:, 1, 2] == height]
        tops.append(np.stack([ending[:, 0].min(axis=0), ending[:, 1].max(axis=0)]))
    return tops


def _grid(top: Floats, spacing_m: float) -> Floats:
    """Points [K,3] on the upper face of a box [2,3]."""
    size = top[1] - top[0]
    counts = np.maximum(1, np.floor(size[:2] / spacing_m)).astype(int)
    x, y = (top[0, k] + (np.arange(counts[k]) + 0.5) * size[k] / counts[k] for k in range(2))
    columns, rows = np.meshgrid(x, y)
    return np.stack([columns, rows, np.full_like(columns, top[1, 2])], axis=-1).reshape(-1, 3)


def problems(home: Home) -> list[str]:
    """What is physically wrong with a home, in words; empty when nothing is.

    Movable objects must stand on their parents; fixed ones may hang on them; no two may overlap.
    """
    found = []
    for thing in home.objects:
        if thing.parent is None:
            if thing.movable:
                found.append(f"{thing.id} is movable and stands on nothing")
            continue
        parent = home[thing.parent]
        if stands_on(thing, parent) or (not thing.movable and hangs_on(thing, parent)):
            continue
        found.append(f"{thing.id} does not rest on {parent.id}")
    every, owner = _joined(list(home.objects))
    pairs = colliding_pairs(every, every)
    owners = np.unique(owner[pairs[owner[pairs[:, 0]] < owner[pairs[:, 1]]]], axis=0)
    found += [f"{home.objects[i].id} overlaps {home.objects[j].id}" for i, j in owners]
    return found
