"""Viewpoints of a scene change task: an initial one, and near and far test viewpoints."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gslts.types import Floats
from gslts_sim.actions import GRID_M
from gslts_sim.home import Home
from gslts_sim.robot_body import Viewpoint
from gslts_sim.task import VIEWPOINTS, ViewpointSets
from gslts_sim.viewpoints import SIZE_PX, ObjectVisibility, camera_positions, viewpoint_towards
from gslts_sim.walkable import floor_of

MAX_NEAR_VIEW_M = 1.75
"""Distance between the camera and the changed object below which a test viewpoint is near, m."""
VIEW_DISTANCE_M = (0.7, 5.0)
"""Minimum and maximum distance of a viewpoint from the object's centre, in every state, m: within
the range of depth cameras."""
FIRST_VIEW_FRACTION = np.array([0.001, 0.25])
"""Minimum and maximum fraction of the image that the object covers at the initial viewpoint, in
each state that has it: neither too small to detect nor filling the view."""
MIN_TEST_VIEW_FRACTION = 0.0002
"""Minimum fraction of the image that the object covers at a test viewpoint, in one state."""
MIN_VISIBLE_FRACTION = 0.3
"""Minimum fraction of the object's sample points visible from a position; a cheap test before views
are rendered."""
MAX_VIEWS_PER_POSITION = 2
"""Maximum number of test viewpoints at one position, in different directions."""
JITTER_DEG = 12.0
"""Half range of the random turn of a view away from the object, degrees: objects are not always in
the middle of the image."""


class NoTaskError(Exception):
    """A change that makes no task; the message says why."""


def candidate_positions(
    home: Home, changed: Home, targets: Sequence[ObjectVisibility], rng: np.random.Generator
) -> Floats:
    """Return positions that the robot can reach in both states at a useful distance, shuffled.

    Args:
        home: Before the change.
        changed: After the change.
        targets: The changed object in each state that has it.
        rng: Source of randomness.

    Returns:
        [P,2] x and y, m.

    Raises:
        NoTaskError: There is none.
    """
    positions = floor_of(home).grid_positions(GRID_M)
    floor_after = floor_of(changed)
    positions = positions[[floor_after.can_stand(position) for position in positions]]
    eyes = camera_positions(home, positions)
    for target in targets:
        metres = np.linalg.norm(eyes - target.center, axis=1)
        kept = (metres >= VIEW_DISTANCE_M[0]) & (metres <= VIEW_DISTANCE_M[1])
        positions, eyes = positions[kept], eyes[kept]
    if len(positions) == 0:
        raise NoTaskError("not seen from one position in all states")
    return positions[rng.permutation(len(positions))]


def initial_viewpoint(
    home: Home, targets: Sequence[ObjectVisibility], positions: Floats, rng: np.random.Generator
) -> Viewpoint:
    """Sample a viewpoint that sees the object in every state that has it.

    Args:
        home: Before the change.
        targets: The changed object in each state that has it.
        positions: [P,2] candidates, m; the first suitable one is taken.
        rng: Source of randomness.

    Raises:
        NoTaskError: There is none.
    """
    visible = np.min([target.visible_fraction(positions) for target in targets], axis=0)
    center = np.mean([target.center for target in targets], axis=0)
    min_px, max_px = FIRST_VIEW_FRACTION * np.prod(SIZE_PX)
    for position in positions[visible >= MIN_VISIBLE_FRACTION]:
        viewpoint = viewpoint_towards(home, position, center, _jitter(rng))
        if all(min_px <= target.visible_px(viewpoint) <= max_px for target in targets):
            return viewpoint
    raise NoTaskError("not seen from one position in all states")


def near_and_far_viewpoints(
    home: Home, targets: Sequence[ObjectVisibility], positions: Floats, rng: np.random.Generator
) -> ViewpointSets:
    """Sample near and far viewpoints that see the object in one of its states.

    Args:
        home: Before the change.
        targets: The changed object in each state that has it.
        positions: [P,2] candidates, m, in this order.
        rng: Source of randomness.

    Raises:
        NoTaskError: There are too few.
    """
    near: list[Viewpoint] = []
    far: list[Viewpoint] = []
    visible = [target.visible_fraction(positions) for target in targets]
    for turn in range(MAX_VIEWS_PER_POSITION):
        for number, position in enumerate(positions):
            state = (turn + number) % len(targets)
            target = targets[state]
            eye = camera_positions(home, position[None])
            found = near if float(np.linalg.norm(eye - target.center)) < MAX_NEAR_VIEW_M else far
            if len(found) == VIEWPOINTS or visible[state][number] < MIN_VISIBLE_FRACTION:
                continue
            viewpoint = viewpoint_towards(home, position, target.center, _jitter(rng))
            min_px = MIN_TEST_VIEW_FRACTION * np.prod(SIZE_PX)
            if viewpoint not in found and target.visible_px(viewpoint) >= min_px:
                found.append(viewpoint)
    for name, found in (("near", near), ("far", far)):
        if len(found) < VIEWPOINTS:
            raise NoTaskError(f"seen from fewer than {VIEWPOINTS} {name} viewpoints")
    return ViewpointSets(near=tuple(near), far=tuple(far))


def _jitter(rng: np.random.Generator) -> Floats:
    return rng.uniform(-JITTER_DEG, JITTER_DEG, 2)
