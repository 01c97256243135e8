"""A trip of a robot to one of several targets: goals, steps, and the search at the goal.

As in SAVN (Wortsman et al. 2019), a robot succeeds if the object is in view and within 1 m.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.core.robot import Robot
from gslts.navigation.terrain import Terrain
from gslts.navigation.viewpoints import Target, TargetView, ViewpointRenderer
from gslts.navigation.visibility import matching_points, visible_points
from gslts.navigation.walk import MAX_MOVES, Walk
from gslts.semantics.source import SemanticSource
from gslts.types import Floats

Status = Literal["reached", "not found", "unreachable", "lost track"]

SUCCESS_DISTANCE_M = 1.0
"""Maximum distance along the floor to the nearest point of the object, that of SAVN."""
GOAL_DISTANCE_M = 0.98
"""Maximum distance of a goal position from the object: poses err by about a centimetre."""
MAX_VIEWPOINTS = 4
"""Number of viewpoints tried before an object counts as gone."""
YAW_OFFSETS_RAD = (0.0, 0.4, -0.4)
"""Directions tried at a viewpoint, relative to the planned one."""
MIN_VISIBLE_SHARE = 0.5
"""Minimum share of the expected points of an object at the measured depth; below, it is gone."""
MIN_MATCHING_SHARE = 0.25
"""Minimum share of the expected points at which the frame matches the text; a flat object that is
gone does not change depth."""


@dataclass(frozen=True, eq=False)
class NavigationResult:
    """Result of a trip to an object.

    Attributes:
        status: "reached", or the kind of failure.
        reason: Reason of the failure; empty if the object was reached.
        path: [P,2] positions of the robot as it believes them, x and y in the world, m.
        frame: The last frame.
        replans: Number of times that a path was planned again on the way.
        distance_m: Distance along the floor from the last position to the nearest point of the
            object, m; None if it was not reached.
    """

    status: Status
    reason: str
    path: Floats
    frame: RgbdFrame
    replans: int
    distance_m: float | None = None

    def describe(self) -> str:
        """Return in words how the trip ended."""
        if self.distance_m is None:
            return f"{self.status}: {self.reason}"
        return f"reached, {self.distance_m:.1f} m from it after {self.length_m:.1f} m"

    @property
    def length_m(self) -> float:
        """Length of the path, m."""
        return float(np.linalg.norm(np.diff(self.path, axis=0), axis=1).sum())


@dataclass(frozen=True, eq=False)
class _Goal:
    """A position to go to, and the view of a target expected there.

    Attributes:
        position: (2,) x and y in the world, m.
        key: Numbers of the target and of the position.
        view: View of the target from the position.
    """

    position: Floats
    key: tuple[int, int]
    view: TargetView


class Trip:
    """State of a robot on its way to one of several targets.

    Args:
        robot: The robot.
        text: Text that the targets match.
        gaussian_map: float32; shows from where the targets are visible.
        terrain: Free floor of the robot; learns obstacles.
        source: Encodes the text, and segments frames if it can; None if the text is only a name.
        on_move: Called after each move.
    """

    def __init__(
        self,
        robot: Robot,
        text: str,
        gaussian_map: GaussianMap,
        terrain: Terrain,
        source: SemanticSource | None,
        on_move: Callable[[], None],
    ) -> None:
        self._walk = Walk(robot, terrain, on_move)
        self._text, self._terrain, self._source = text, terrain, source
        self._positions = robot.reachable_positions()
        self._renderer = ViewpointRenderer(gaussian_map, self._walk.frame.camera)
        self._views: dict[tuple[int, int], TargetView] = {}
        self._excluded: set[tuple[int, int]] = set()

    def go_to_any(self, targets: Sequence[Target]) -> NavigationResult:
        """Go to the nearest target that the robot can see at the end.

        Args:
            targets: Objects that match the text.

        Returns:
            The result.
        """
        name = self._text
        if not targets:
            return self._result("not found", f"the map has no {name}")
        if not self._terrain.is_known(self._walk.position):
            x, y = self._walk.position.tolist()
            return self._result("lost track", f"the map has no floor around ({x:.2f}, {y:.2f})")
        tried = [0] * len(targets)
        while not self._walk.is_over:
            candidates = [k for k, count in enumerate(tried) if count < MAX_VIEWPOINTS]
            goal = self._nearest_goal(candidates, targets)
            if goal is None and any(tried):
                return self._result("not found", f"no {name} is where the map has one")
            if goal is None:
                return self._result("unreachable", self._unreachable_reason(targets))
            path = self._terrain.plan(self._walk.position, goal.position)
            if path.reason:
                self._excluded.add(goal.key)
                continue
            if not self._walk.follow(path):
                continue
            target = targets[goal.key[0]]
            if self._search(target, goal):
                distance_m = float(target.distances_m(self._walk.position[None])[0])
                return self._result("reached", "", distance_m)
            tried[goal.key[0]] += 1
            self._excluded.add(goal.key)
        return self._result("lost track", f"the robot did not arrive after {MAX_MOVES} moves")

    def _result(
        self, status: Status, reason: str, distance_m: float | None = None
    ) -> NavigationResult:
        walk = self._walk
        path = np.array(walk.path)
        return NavigationResult(status, reason, path, walk.frame, walk.replans, distance_m)

    def _unreachable_reason(self, targets: Sequence[Target]) -> str:
        where = f"within {SUCCESS_DISTANCE_M:g} m of any {self._text}"
        distances = [target.distances_m(self._positions) for target in targets]
        if not any((target_m <= GOAL_DISTANCE_M).any() for target_m in distances):
            return f"the robot has no reachable position {where}"
        return f"there is no path to a position {where} from which it is visible"

    def _nearest_goal(self, candidates: Sequence[int], targets: Sequence[Target]) -> _Goal | None:
        """Return the goal with the shortest path from which a candidate should be visible."""
        lengths_m = self._terrain.path_lengths_m(self._walk.position, self._positions)
        keys = []
        for number in candidates:
            near = targets[number].distances_m(self._positions) <= GOAL_DISTANCE_M
            rows = np.flatnonzero(near & np.isfinite(lengths_m)).tolist()
            keys += [(float(lengths_m[row]), number, row) for row in rows]
        for _, number, row in sorted(keys):
            key, position = (number, row), self._positions[row]
            if key in self._excluded:
                continue
            if key not in self._views:
                self._views[key] = self._renderer.view(position, targets[number])
            if self._views[key].is_sufficient:
                return _Goal(position, key, self._views[key])
        return None

    def _search(self, target: Target, goal: _Goal) -> bool:
        """Look for a target from a goal; return True if it is visible and near."""
        view = goal.view
        expected = target.points[view.visible]
        for offset_rad in YAW_OFFSETS_RAD:
            self._walk.move(goal.position, view.yaw_rad + offset_rad, view.pitch_rad)
            frame = self._walk.frame.registered()
            near = target.distances_m(self._walk.position[None])[0] <= SUCCESS_DISTANCE_M
            if near and frame.fault is None and self._is_visible(frame, expected):
                return True
        return False

    def _is_visible(self, frame: RgbdFrame, expected: Floats) -> bool:
        """Test if a registered frame shows the object, by points that should be visible."""
        if visible_points(expected, frame.camera, frame.depth).mean() < MIN_VISIBLE_SHARE:
            return False
        if self._source is None:
            return True
        try:
            matching = matching_points(expected, frame, self._source, self._text)
        except ValueError:  # The source encodes texts only, or the frame has no labels.
            return True
        return bool(matching.mean() >= MIN_MATCHING_SHARE)
