"""Oriented boxes and their collision test.

Boxes touch when they overlap by less than `CONTACT_M`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gslts.types import Bools, Floats, Ints

CONTACT_M = 0.002
"""Maximum overlap of boxes that do not collide, m: twice what rounded edges and cloth take up."""


@dataclass(frozen=True, eq=False)
class OrientedBoxes:
    """A set of oriented boxes.

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
    def from_object(cls, boxes: Floats, world_from_object: Floats) -> OrientedBoxes:
        """Transform boxes from the frame of an object to the world.

        Args:
            boxes: [B,2,3] float64, lower and upper corners, m.
            world_from_object: [4,4] or [P,4,4] float64, m: P poses give P * B boxes, those of one
                pose side by side.
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
    def concatenate(cls, several: list[OrientedBoxes]) -> OrientedBoxes:
        """Return the union of several sets.

        Args:
            several: In this order; may be empty.
        """
        several = [OrientedBoxes.from_object(np.zeros((0, 2, 3)), np.eye(4)), *several]
        return cls(
            np.concatenate([boxes.centers for boxes in several]),
            np.concatenate([boxes.halves for boxes in several]),
            np.concatenate([boxes.axes for boxes in several]),
        )

    def __getitem__(self, rows: Ints | Bools | slice) -> OrientedBoxes:
        return OrientedBoxes(self.centers[rows], self.halves[rows], self.axes[rows])

    @cached_property
    def bounds(self) -> tuple[Floats, Floats]:
        """Lower and upper corners [N,3] of the axis-aligned boxes around them, m."""
        reach = (np.abs(self.axes) * self.halves[:, None, :]).sum(axis=2)
        return self.centers - reach, self.centers + reach


def overlap_m(first: OrientedBoxes, second: OrientedBoxes) -> Floats:
    """Compute the penetration depth of box i of one set and box i of the other.

    Args:
        first: N boxes.
        second: N boxes.

    Returns:
        [N] float64, m: the shortest shift that separates them; negative where there is a gap of at
        least that width.

    Source: separating axes of two boxes, Gottschalk et al. 1996, OBBTree.
    """
    a, b = first.halves, second.halves
    # The axes of the second box and the shift to its centre, in the frame of the first.
    turn = first.axes.transpose(0, 2, 1) @ second.axes
    shift = np.einsum("nki,nk->ni", first.axes, second.centers - first.centers)
    size = np.abs(turn)
    of_first = a + np.einsum("nij,nj->ni", size, b) - np.abs(shift)
    of_second = b + np.einsum("nij,ni->nj", size, a) - np.abs(np.einsum("nij,ni->nj", turn, shift))
    j, k = [1, 2, 0], [2, 0, 1]
    reach = a[:, j, None] * size[:, k] + a[:, k, None] * size[:, j]
    reach += b[:, None, j] * size[:, :, k] + b[:, None, k] * size[:, :, j]
    between = np.abs(shift[:, k, None] * turn[:, j] - shift[:, j, None] * turn[:, k])
    lengths = np.sqrt(np.maximum(1 - turn * turn, 0))
    # Parallel edges span no plane: the normals of the faces suffice then.
    spans = lengths > 1e-4
    of_edges = np.where(spans, (reach - between) / np.where(spans, lengths, 1), np.inf)
    depths = [of_first, of_second, of_edges.reshape(-1, 9)]
    depth: Floats = np.concatenate(depths, axis=1).min(axis=1)
    return depth


def colliding_pairs(
    first: OrientedBoxes, second: OrientedBoxes, contact_m: float = CONTACT_M
) -> Ints:
    """Find the pairs of boxes of two sets that collide.

    Args:
        first: N boxes.
        second: M boxes.
        contact_m: Maximum overlap that is no collision, m.

    Returns:
        [P,2] indices.
    """
    lower, upper = first.bounds
    other_lower, other_upper = second.bounds
    if len(first) == 0:
        return np.zeros((0, 2), np.intp)
    # The box around the first set excludes most of the second.
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
    """Return whether any boxes of two sets collide.

    Args:
        first: N boxes.
        second: M boxes.
        contact_m: Maximum overlap that is no collision, m.
    """
    return len(colliding_pairs(first, second, contact_m)) > 0
