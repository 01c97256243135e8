"""Objects that are shifted a little, with all that stands on them, and viewpoints that see them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import zip_longest

import numpy as np

from gslts.types import Floats
from gslts_bench.detection.truth import Truth, as_motion, in_view_px
from gslts_sim.actions import SceneState, ShiftObject
from gslts_sim.changes import FLOOR_TYPES, ChangeError
from gslts_sim.home import Home, HomeObject
from gslts_sim.ray_scene import RayScene
from gslts_sim.robot_body import Viewpoint
from gslts_sim.task import Box, Change
from gslts_sim.task_viewpoints import NoTaskError, candidate_positions, initial_viewpoint
from gslts_sim.viewpoints import ObjectVisibility

SHIFT_M, SHIFT_DEG = (0.03, 0.12), 8.0
"""Range of the distance of a shift, and maximum of its turn: less is within the errors of the pose
and the map, and more leaves a gap that shows a removal and an addition."""
FURNITURE = ("CoffeeTable", "Desk", "DiningTable", "SideTable")
"""Types of furniture that people push when they pass it, besides all movable objects."""
ROUNDS = 4
"""Maximum number of shifts that are tried per object: many collide or are not seen."""


@dataclass(frozen=True, eq=False)
class Shifted:
    """A shift and a viewpoint that sees the object as well as a single task must."""

    action: ShiftObject
    viewpoint: Viewpoint
    truth: Truth


def draw_shifts(before: SceneState, count: int, rng: np.random.Generator) -> Iterator[Shifted]:
    """Yield up to `count` shifts, of each object once.

    Args:
        before: Default state of the home.
        count: Maximum number of shifts.
        rng: Source of all randomness.
    """
    scene, left, made = RayScene(before.home), _objects(before.home, rng), 0
    for _ in range(ROUNDS):
        failed = []
        for obj in left:
            if made == count:
                return
            shifted = _draw(before, scene, obj, rng)
            if shifted is None:
                failed.append(obj)
                continue
            made += 1
            yield shifted
        left = failed


def _objects(home: Home, rng: np.random.Generator) -> list[HomeObject]:
    """Return what may be shifted in random order, in turn from the floor and from elsewhere."""
    groups: tuple[list[HomeObject], list[HomeObject]] = ([], [])
    for obj in home.objects:
        if obj.parent is not None and (obj.movable or obj.type in FURNITURE):
            groups[home[obj.parent].type not in FLOOR_TYPES].append(obj)
    drawn = [[group[row] for row in rng.permutation(len(group))] for group in groups]
    return [obj for pair in zip_longest(*drawn) for obj in pair if obj is not None]


def _draw(
    before: SceneState, scene: RayScene, obj: HomeObject, rng: np.random.Generator
) -> Shifted | None:
    """Draw a shift of an object; None if it is impossible or not seen well enough."""
    angle, metres = 2 * np.pi * rng.uniform(), rng.uniform(*SHIFT_M)
    dx, dy = np.round([metres * np.cos(angle), metres * np.sin(angle)], 4).tolist()
    degrees = round(float(rng.uniform(-SHIFT_DEG, SHIFT_DEG)), 2)
    action = ShiftObject(objectId=obj.id, dx=dx, dy=dy, degrees=degrees)
    try:
        after = before.apply(action)
        targets = [
            ObjectVisibility(before.home, scene, obj.id),
            ObjectVisibility(after.home, RayScene(after.home), obj.id),
        ]
        positions = candidate_positions(before.home, after.home, targets, rng)
        viewpoint = initial_viewpoint(before.home, targets, positions, rng)
    except (ChangeError, NoTaskError):
        return None
    box_before, box_after = (_box(target.obj.box_in_world) for target in targets)
    change = Change(
        kind="shift",
        object_id=obj.id,
        object_type=obj.type,
        box_before=box_before,
        box_after=box_after,
    )
    moved = after.home[obj.id].world_from_object @ np.linalg.inv(obj.world_from_object)
    size_px = in_view_px(change, before, after, viewpoint)
    return Shifted(
        action, viewpoint, Truth(change=change, size_px=size_px, motion=as_motion(moved))
    )


def _box(box: Floats) -> Box:
    low, high = np.round(box, 6).tolist()
    return tuple(low), tuple(high)
