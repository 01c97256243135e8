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
from gslts.navigation.terrain import MAX_HEIGHT_M, Terrain
from gslts.navigation.viewpoints import Target, TargetView, ViewpointRenderer
from gslts.navigation.visibility import matching_points, visible_points
from gslts.navigation.walk import Walk
from gslts.semantics.source import SemanticSource
from gslts.types import Bools, Floats

Status = Literal["reached", "not found", "unreachable", "lost track"]

SUCCESS_DISTANCE_M = 1.0
"""Maximum distance along the floor to the nearest point of the object, that of SAVN."""
GOAL_DISTANCE_M = 0.98
"""Maximum distance of a goal position from the object: poses err by about a centimetre."""
MAX_VIEWPOINTS = 4
"""Number of viewpoints tried before an object counts as gone."""
SEARCHED_M = 0.5
"""Minimum distance between two of them, m: from beside the first one, the same would hide the
object."""
MAX_VIEWS, VIEW_SPACING_M = 150, 0.15
"""Maximum number of positions from which views of an object are rendered, and minimum distance of
such a position from others that do not see it, m. Bounds time where thousands of positions around
an object do not see it. At 0.2 m, three of 40 objects in furniture were missed, at 0.15 m none; 150
fill a circle of 1.1 m."""
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
        target: Number of the target.
        view: View of the target from the position.
    """

    position: Floats
    target: int
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
        self._views: list[dict[int, TargetView]] = []  # By position, for each target.
        self._open: Bools = np.zeros((0, 0), np.bool_)  # Goals that are left: target, position.

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
        eye = self._walk.frame.camera.world_from_camera[:3, 3]
        if not self._terrain.is_known(eye):
            x, y, z = eye.tolist()
            where = f"around ({x:.2f}, {y:.2f}) within {MAX_HEIGHT_M:g} m below the camera"
            return self._result("lost track", f"the map has no floor {where} at z = {z:.2f} m")
        self._open = np.array(
            [t.distances_m(self._positions, GOAL_DISTANCE_M) <= GOAL_DISTANCE_M for t in targets]
        )
        self._views = [{} for _ in targets]
        has_near, tried = bool(self._open.any()), [0] * len(targets)
        while not self._walk.is_over:
            goal = self._nearest_goal(targets)
            if goal is None and any(tried):
                return self._result("not found", f"no {name} is where the map has one")
            if goal is None:
                return self._result("unreachable", self._unreachable_reason(has_near))
            path = self._terrain.plan(self._walk.position, goal.position)
            if path.reason:
                self._exclude(goal, 0.0)
                continue
            if not self._walk.follow(path):
                continue
            target = targets[goal.target]
            if self._search(target, goal):
                distance_m = float(target.distances_m(self._walk.position[None])[0])
                return self._result("reached", "", distance_m)
            tried[goal.target] += 1
            self._exclude(goal, SEARCHED_M if tried[goal.target] < MAX_VIEWPOINTS else np.inf)
        return self._result("lost track", self._walk.over_reason)

    def _result(
        self, status: Status, reason: str, distance_m: float | None = None
    ) -> NavigationResult:
        walk = self._walk
        path = np.array(walk.path)
        return NavigationResult(status, reason, path, walk.frame, walk.replans, distance_m)

    def _unreachable_reason(self, has_near: bool) -> str:
        where = f"within {SUCCESS_DISTANCE_M:g} m of any {self._text}"
        if not has_near:
            return f"the robot has no reachable position {where}"
        return f"there is no path to a position {where} from which it is visible"

    def _nearest_goal(self, targets: Sequence[Target]) -> _Goal | None:
        """Return the goal with the shortest path from which its target should be visible."""
        lengths_m, used = np.full(len(self._positions), np.inf), self._open.any(axis=0)
        lengths_m[used] = self._terrain.path_lengths_m(self._walk.position, self._positions[used])
        numbers, rows = np.nonzero(self._open & np.isfinite(lengths_m))
        for index in np.argsort(lengths_m[rows], kind="stable"):
            number, row = int(numbers[index]), int(rows[index])
            if not self._open[number, row]:
                continue
            views, position = self._views[number], self._positions[row]
            if row not in views:
                views[row] = self._renderer.view(position, targets[number])
            goal = _Goal(position, number, views[row])
            if goal.view.is_sufficient:
                return goal
            goals = [k for k, view in views.items() if view.is_sufficient and self._open[number, k]]
            self._exclude(goal, VIEW_SPACING_M if len(views) < MAX_VIEWS else np.inf)
            self._open[number, goals] = True  # They stay, however near.
        return None

    def _exclude(self, goal: _Goal, radius_m: float) -> None:
        """Plan no more to a goal, nor to positions nearer to it than a radius, for its target."""
        offsets_m = np.linalg.norm(self._positions - goal.position, axis=1)
        self._open[goal.target, (offsets_m == 0) | (offsets_m < radius_m)] = False

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
