"""Decision if an own version can follow the versions of others: elsewhere, or of the same region.

An update changes the Gaussians that its delta names, and those near its change boxes decide what it
does there. It is *elsewhere* if none of these differs between the map that it was made of and the
newest shared one: then the same delta is committed again, and the result is, bit by bit, that of a
robot that had committed it second. Any other version is of the *same region*.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from gslts.core.gaussian_map import GaussianMap
from gslts.fleet.replica import OwnVersion
from gslts.fleet.shared_version import SharedVersion
from gslts.store.causes import Box, ChangeRecord, UpdateCause, ViewsCause
from gslts.store.delta import Delta, apply_deltas, compare_by_ids
from gslts.types import Bools, Floats

REACH_M = 0.45
"""Distance from a change box, m, within which other Gaussians decide what an update does there: the
default of `RefineConfig.reach_m`. At half, an update may be replayed whose refinement saw another
map; at double, more updates are verified anew."""


@dataclass(frozen=True, eq=False)
class Attempt:
    """An own version that is to follow the newest version of others.

    Attributes:
        own: The version.
        cause: Its cause.
        delta: Its changes; new Gaussians have ids that others have not used.
        before: Own map that it was made of.
        head: Newest map of others, with the own versions before this one.
        theirs: Versions of others that `before` lacks.
    """

    own: OwnVersion
    cause: ViewsCause
    delta: Delta
    before: GaussianMap
    head: GaussianMap
    theirs: Sequence[SharedVersion]

    @property
    def changes(self) -> tuple[ChangeRecord, ...]:
        """Changes that the version shows; none of an extension."""
        return self.cause.changes if isinstance(self.cause, UpdateCause) else ()

    @cached_property
    def after(self) -> GaussianMap:
        """Own map with the version."""
        return apply_deltas(self.before, [self.delta])

    @cached_property
    def boxes(self) -> list[Box]:
        """Boxes of the changes, world, m; without any, the box of the Gaussians that it touches."""
        boxes = [box for change in self.changes for box in change.boxes if box is not None]
        if boxes or not self.delta.touched:
            return boxes
        points = touched_points(self.delta, self.before)
        return [(tuple(points.min(axis=0).tolist()), tuple(points.max(axis=0).tolist()))]

    @property
    def is_elsewhere(self) -> bool:
        """True if others changed nothing that the version depends on."""
        difference = compare_by_ids(self.before, self.head)
        touched = np.concatenate([self.delta.removed, self.delta.changed.ids])
        differing = np.concatenate([difference.removed, difference.changed.ids])
        if np.isin(touched, differing).any():
            return False
        points = touched_points(difference, self.before)
        return not any(is_near(points, box).any() for box in self.boxes)

    def rivals(self, boxes: Iterable[Box | None], margin_m: float) -> list[SharedVersion]:
        """Return the versions of others with changes near some boxes.

        Args:
            boxes: World, m; None is at no position.
            margin_m: Maximum distance along each axis, m.

        Returns:
            Oldest first.
        """
        wanted = [box for box in boxes if box is not None]
        return [
            shared
            for shared in self.theirs
            if any(_overlap(box, other, margin_m) for box in wanted for other in _boxes_of(shared))
        ]

    def describe_rival(self, boxes: Iterable[Box | None]) -> str:
        """Name the last version of others with changes near some boxes, or else their last one.

        Args:
            boxes: World, m; None is at no position.
        """
        version = [*self.theirs, *self.rivals(boxes, REACH_M)][-1].version
        return f"version {version.number} of {version.robot or 'another robot'}"


def touched_points(delta: Delta, before: GaussianMap) -> Floats:
    """Return the centres of all Gaussians that a delta removes, adds or changes.

    Args:
        delta: From `before`.
        before: With rising ids.

    Returns:
        [P,3] old and new centres, world, m.
    """
    known = np.concatenate([delta.removed, delta.changed.ids])
    old = before.means[np.isin(before.ids, known)]
    points: Floats = np.concatenate([old, delta.added.means, delta.changed.means]) + before.origin
    return points


def is_near(points: Floats, box: Box) -> Bools:
    """Return which points lie within `REACH_M` of a box.

    Args:
        points: [P,3] world, m.
        box: World, m.

    Returns:
        [P] bool.
    """
    low, high = np.array(box)
    near: Bools = ((points >= low - REACH_M) & (points <= high + REACH_M)).all(axis=1)
    return near


def _boxes_of(shared: SharedVersion) -> list[Box]:
    cause = shared.version.cause
    changes = cause.changes if isinstance(cause, UpdateCause) else ()
    return [box for change in changes for box in change.boxes if box is not None]


def _overlap(box: Box, other: Box, margin_m: float) -> bool:
    """Return whether two boxes are within a distance of each other along each axis."""
    return all(
        box[0][axis] - margin_m <= other[1][axis] and other[0][axis] - margin_m <= box[1][axis]
        for axis in range(3)
    )
