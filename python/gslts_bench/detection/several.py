"""Several changes at once, and a viewpoint from which all of them are seen."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from gslts_bench.detection.truth import Truth, in_view_px
from gslts_sim.actions import GRID_M, ChangeAction, SceneState
from gslts_sim.changes import ChangeError
from gslts_sim.ray_scene import RayScene
from gslts_sim.robot_body import Viewpoint
from gslts_sim.task import Task
from gslts_sim.task_viewpoints import (
    FIRST_VIEW_FRACTION,
    JITTER_DEG,
    MIN_VISIBLE_FRACTION,
    VIEW_DISTANCE_M,
)
from gslts_sim.viewpoints import SIZE_PX, ObjectVisibility, camera_positions, viewpoint_towards
from gslts_sim.walkable import floor_of

TRIES_PER_CASE = 40
"""Maximum number of sets of changes tried per set that is wanted."""
VIEWPOINTS_PER_SET = 12
"""Maximum number of viewpoints tried per set of changes."""


@dataclass(frozen=True, eq=False)
class Several:
    """Consecutive changes and a viewpoint that sees each as well as a single task must."""

    actions: tuple[ChangeAction, ...]
    viewpoint: Viewpoint
    truths: tuple[Truth, ...]


class SeveralMaker:
    """Combines the changes of single tasks of one home.

    Args:
        before: Default state of the home.
        tasks: Tasks from that state.
        rng: Source of all randomness.
    """

    def __init__(self, before: SceneState, tasks: Sequence[Task], rng: np.random.Generator) -> None:
        self._before, self._tasks, self._rng = before, tasks, rng
        self._scene = RayScene(before.home)

    def make(self, size: int, count: int) -> Iterator[Several]:
        """Yield up to `count` different sets of `size` changes.

        Args:
            size: Number of changes of a set.
            count: Maximum number of sets.
        """
        known: set[frozenset[int]] = set()
        made = 0
        for _ in range(TRIES_PER_CASE * count):
            if made == count or size > len(self._tasks):
                return
            rows = self._rng.choice(len(self._tasks), size, replace=False).tolist()
            if frozenset(rows) in known:
                continue
            known.add(frozenset(rows))
            several = self._combine([self._tasks[row] for row in rows])
            if several is not None:
                made += 1
                yield several

    def _combine(self, tasks: Sequence[Task]) -> Several | None:
        """Combine tasks; None if they exclude each other or no viewpoint sees all."""
        if len({task.change.object_id for task in tasks}) < len(tasks):
            return None
        actions = tuple(action for task in tasks for action in task.change_actions)
        after = self._before
        try:
            for action in actions:
                after = after.apply(action)
        except ChangeError:
            return None
        viewpoint = self._find_viewpoint(tasks, after)
        if viewpoint is None:
            return None
        truths = [
            Truth(
                change=task.change, size_px=in_view_px(task.change, self._before, after, viewpoint)
            )
            for task in tasks
        ]
        return Several(actions, viewpoint, tuple(truths))

    def _find_viewpoint(self, tasks: Sequence[Task], after: SceneState) -> Viewpoint | None:
        scene = RayScene(after.home)
        visibilities = []
        for task in tasks:
            change = task.change
            if change.box_before is not None:
                visibilities.append(
                    ObjectVisibility(self._before.home, self._scene, change.object_id)
                )
            if change.box_after is not None:
                visibilities.append(ObjectVisibility(after.home, scene, change.object_id))
        floors = [floor_of(self._before.home), floor_of(after.home)]
        places = floors[0].grid_positions(GRID_M)
        places = places[[floors[1].can_stand(place) for place in places]]
        eyes = camera_positions(self._before.home, places)
        middles = np.stack([visibility.center for visibility in visibilities])
        metres = np.linalg.norm(eyes[:, None] - middles, axis=-1)
        fit = ((metres >= VIEW_DISTANCE_M[0]) & (metres <= VIEW_DISTANCE_M[1])).all(axis=1)
        places = self._rng.permutation(places[fit])
        if len(places) == 0:
            return None
        shares = np.min(
            [visibility.visible_fraction(places) for visibility in visibilities], axis=0
        )
        least, most = FIRST_VIEW_FRACTION * np.prod(SIZE_PX)
        for place in places[shares >= MIN_VISIBLE_FRACTION][:VIEWPOINTS_PER_SET]:
            jitter_deg = self._rng.uniform(-JITTER_DEG, JITTER_DEG, 2)
            viewpoint = viewpoint_towards(
                self._before.home, place, middles.mean(axis=0), jitter_deg
            )
            if all(
                least <= visibility.visible_px(viewpoint) <= most for visibility in visibilities
            ):
                return viewpoint
        return None
