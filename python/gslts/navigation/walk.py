"""Moves of a robot along planned paths."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from gslts.core.robot import Robot
from gslts.navigation.planner import PlannedPath
from gslts.navigation.terrain import Terrain
from gslts.types import Floats

STEP_M = 0.25
"""Length of a step along a path: the grid of the simulated robot."""
POSITION_TOLERANCE_M = 0.2
"""Maximum distance between the target of a step and the position after it. A robot on a grid of
0.25 m is up to 0.18 m off."""
MIN_STEP_M = 0.02
"""Minimum length of a step to a corner of a path; the direction of a shorter one is arbitrary."""
MAX_MOVES = 200
"""Number of moves, beyond the steps of the longest planned path, after which a trip is given up."""
PATH_PITCH_RAD = 0.4
"""Pitch of the camera on a path: the floor is visible from about 0.7 m ahead."""


class Walk:
    """Moves a robot along paths in steps, and learns obstacles on the way.

    Args:
        robot: The robot.
        terrain: Free floor of the robot; learns obstacles.
        on_move: Called after each move.

    Attributes:
        frame: The last frame.
        path: Positions (2,) of the robot as it believes them, x and y in the world, m.
        replans: Number of times that a path was left before its end.
    """

    def __init__(self, robot: Robot, terrain: Terrain, on_move: Callable[[], None]) -> None:
        self._robot, self._terrain, self._on_move = robot, terrain, on_move
        self.frame = robot.observe()
        self.path = [self.position]
        self.replans = 0
        self._longest_m = 0.0

    @property
    def position(self) -> Floats:
        """(2,) position that the robot believes, x and y in the world, m."""
        position: Floats = self.frame.camera.world_from_camera[:2, 3].copy()
        return position

    @property
    def is_over(self) -> bool:
        """True after too many moves; see `MAX_MOVES`."""
        return len(self.path) > MAX_MOVES + self._longest_m / STEP_M

    @property
    def over_reason(self) -> str:
        """Reason why a walk that is over has failed."""
        return f"the robot did not arrive after {len(self.path) - 1} moves"

    def go_near(self, goal: Floats) -> str:
        """Move to the free floor nearest to a position.

        Args:
            goal: (2,) x and y in the world, m.

        Returns:
            Reason why the robot did not arrive; empty if it did.
        """
        while not self.is_over:
            path = self._terrain.plan_near(self.position, goal)
            if path.reason or self.follow(path):
                return path.reason
        return self.over_reason

    def follow(self, path: PlannedPath) -> bool:
        """Move along a path in steps.

        Args:
            path: From the position of the robot.

        Returns:
            False as soon as a new path must be planned, or the walk is over.
        """
        self._longest_m = max(self._longest_m, path.length_m)
        goal, corners = path.points[-1], list(path.points[1:])
        # A path of `Terrain.plan` may end beside the free floor.
        checked = None if self._terrain.is_free(list(path.points[-2:])) else -1
        while np.linalg.norm(goal - self.position) > POSITION_TOLERANCE_M / 2:
            if self.is_over:
                return False
            step = self._next_step(corners)
            x, y = (step - self.position).tolist()
            arrived = self.move(step, float(np.arctan2(y, x)), PATH_PITCH_RAD)
            is_off = not arrived or np.linalg.norm(self.position - step) > POSITION_TOLERANCE_M
            if is_off:
                self._terrain.block(step, self.position)
            has_new = self.frame.fault is None and self._terrain.add_obstacles(self.frame)
            ahead = [self.position, *corners[:checked]]
            if is_off or (has_new and not self._terrain.is_free(ahead)):
                self.replans += 1
                return False
            if step is corners[-1]:
                break
        return True

    def move(self, position: Floats, yaw_rad: float, pitch_rad: float) -> bool:
        """Move the robot, and take a frame; see `Robot.move_towards`.

        Args:
            position: (2,) x and y in the world, m.
            yaw_rad: Final direction of the camera, rad.
            pitch_rad: Final angle of the camera below the horizon, rad.

        Returns:
            True if the robot arrived.
        """
        arrived = self._robot.move_towards(position, yaw_rad, pitch_rad)
        self.frame = self._robot.observe()
        self.path.append(self.position)
        self._on_move()
        return arrived

    def _next_step(self, corners: list[Floats]) -> Floats:
        """Return (2,) the point a step ahead on a path; remove the corners that are passed.

        The step ends at a corner that the straight line to the point beyond would cut.
        """
        position = self.position
        left_m, at = STEP_M, position
        step = _ahead(at, corners[0], left_m)
        while len(corners) > 1 and step is corners[0]:
            left_m -= float(np.linalg.norm(step - at))
            at = corners.pop(0)
            step = _ahead(at, corners[0], left_m)
            is_far = np.linalg.norm(at - position) >= MIN_STEP_M
            if is_far and not self._terrain.is_free([position, step]):
                return at
        return step


def _ahead(start: Floats, end: Floats, length_m: float) -> Floats:
    """Return (2,) the point at a length on a straight line; the end if the line is shorter."""
    offset = end - start
    whole_m = float(np.linalg.norm(offset))
    return end if whole_m <= length_m else start + offset * (length_m / whole_m)
