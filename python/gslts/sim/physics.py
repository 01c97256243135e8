"""What collides, what rests on what, and where there is room: with oriented boxes.

Boxes touch when they overlap by less than `CONTACT_M`; a thing stands on a face when its base is
within `SUPPORT_M` of it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gslts.sim.home import Home, HomeObject

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

CONTACT_M = 0.002
"""Deeper overlaps are collisions: twice what rounded edges and lying cloth take up."""

SUPPORT_M = 0.003
"""Greatest gap between a base and what carries it."""

SUPPORT_SHARE = 0.6
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
        """Boxes [B,2,3] of an object's frame, in the world."""
        rotation, origin = world_from_object[:3, :3], world_from_object[:3, 3]
        middles = boxes.mean(axis=1)
        return cls(
            centers=(middles[:, None, :] * rotation).sum(axis=2) + origin,
            halves=(boxes[:, 1] - boxes[:, 0]) / 2,
            axes=np.broadcast_to(rotation, (len(boxes), 3, 3)),
        )

    @classmethod
    def joined(cls, several: list[OrientedBoxes]) -> OrientedBoxes:
        """All of several sets, which must not be empty together."""
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
    between = second.centers - first.centers
    edges = np.cross(
        first.axes.transpose(0, 2, 1)[:, :, None, :], second.axes.transpose(0, 2, 1)[:, None, :, :]
    ).reshape(-1, 9, 3)
    lengths = np.linalg.norm(edges, axis=2)
    # Edges that are parallel span no plane; the faces' normals tell all then.
    spans = lengths > 1e-6
    edges = edges / np.where(spans, lengths, 1)[:, :, None]
    directions = np.concatenate(
        [first.axes.transpose(0, 2, 1), second.axes.transpose(0, 2, 1), edges], axis=1
    )
    reach = sum(
        (np.abs(np.einsum("ndk,nke->nde", directions, b.axes)) * b.halves[:, None, :]).sum(axis=2)
        for b in (first, second)
    )
    depth: Floats = reach - np.abs(np.einsum("ndk,nk->nd", directions, between))
    depth[:, 6:][~spans] = np.inf
    return depth.min(axis=1)


def colliding_pairs(
    first: OrientedBoxes, second: OrientedBoxes, contact_m: float = CONTACT_M
) -> NDArray[np.intp]:
    """Indices [P,2] of the boxes of two sets that overlap by more than `contact_m`."""
    lower, upper = first.bounds
    other_lower, other_upper = second.bounds
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


def collides(
    first: OrientedBoxes, second: OrientedBoxes, contact_m: float = CONTACT_M
) -> bool:
    """Whether any box of one set overlaps any of the other by more than `contact_m`."""
    return len(colliding_pairs(first, second, contact_m)) > 0


def collisions(home: Home, thing: HomeObject) -> list[str]:
    """Ids of the objects of a home, other than this one itself, that an object collides with."""
    own = boxes_in_world(thing)
    return [
        other.id
        for other in home.objects
        if other.id != thing.id and collides(own, boxes_in_world(other))
    ]


@dataclass(frozen=True, eq=False)
class Footprint:
    """The rectangle that an object covers when seen from above.

    Args:
        points: [K,2] float64, m: points that fill it, its middle first.
        base_m: Height of the object's underside.
    """

    points: Floats
    base_m: float


def footprint(boxes: OrientedBoxes) -> Footprint:
    """The footprint of what an object stands on: of its boxes that reach down to its underside."""
    lower, upper = boxes.bounds
    base = float(lower[:, 2].min())
    standing = boxes[lower[:, 2] < base + SUPPORT_M]
    # In the frame of the first of them, which turns with the object.
    axes = standing.axes[0, :2, :2]
    corners = np.array([(x, y) for x in (-1, 1) for y in (-1, 1)])
    points = standing.centers[:, None, :2] + np.einsum(
        "nij,ncj->nci", standing.axes[:, :2, :2], corners * standing.halves[:, None, :2]
    )
    local = points.reshape(-1, 2) @ axes
    low, high = local.min(axis=0), local.max(axis=0)
    # Steps of a ninth, half a step inside the edge: the share of points is the share of area.
    steps = (np.arange(9) + 0.5) / 9
    grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    middle = (low + high)[None] / 2
    local_points = np.concatenate([middle, low + grid * (high - low)])
    return Footprint(local_points @ axes.T, base)


def supported_share(base: Footprint, parent: OrientedBoxes) -> tuple[bool, float]:
    """Whether upward faces of the parent carry the middle of a footprint, and how much of it all.

    Args:
        base: Of the object that stands.
        parent: Boxes of what it stands on; those whose top is not level carry nothing.
    """
    level = parent.axes[:, 2, 2] > 1 - 1e-6
    tops = parent.centers[:, 2] + parent.halves[:, 2]
    carrying = parent[level & (np.abs(tops - base.base_m) <= SUPPORT_M)]
    if len(carrying) == 0:
        return False, 0.0
    offsets = base.points[None] - carrying.centers[:, None, :2]
    local = np.einsum("npi,nij->npj", offsets, carrying.axes[:, :2, :2])
    inside = (np.abs(local) <= carrying.halves[:, None, :2] + 1e-6).all(axis=2).any(axis=0)
    return bool(inside[0]), float(inside[1:].mean())


def stands_on(thing: HomeObject, parent: HomeObject) -> bool:
    """Whether an object stands on another: its middle and most of its footprint are carried."""
    middle, share = supported_share(footprint(boxes_in_world(thing)), boxes_in_world(parent))
    return middle and share >= SUPPORT_SHARE


def hangs_on(thing: HomeObject, parent: HomeObject) -> bool:
    """Whether an object touches another from the side or from below, as what is fixed does."""
    own, other = boxes_in_world(thing), boxes_in_world(parent)
    first, second = (
        index.ravel() for index in np.meshgrid(np.arange(len(own)), np.arange(len(other)))
    )
    return bool((overlap_m(own[first], other[second]) > -SUPPORT_M).any())


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
    several = [boxes_in_world(thing) for thing in home.objects]
    owner = np.repeat(np.arange(len(several)), [len(boxes) for boxes in several])
    every = OrientedBoxes.joined(several)
    pairs = colliding_pairs(every, every)
    owners = np.unique(owner[pairs[owner[pairs[:, 0]] < owner[pairs[:, 1]]]], axis=0)
    found += [f"{home.objects[i].id} overlaps {home.objects[j].id}" for i, j in owners]
    return found
