"""Grid of the floor that a robot fills online from posed depth images, where there is no map."""

from __future__ import annotations

import cv2
import numpy as np

from gslts.core.frame import RgbdFrame
from gslts.core.robot_body import RobotBody
from gslts.navigation.grid import Grid
from gslts.navigation.local_obstacles import depth_points
from gslts.navigation.semantic_map import (
    CELLS_PER_RADIUS,
    CLOSING_CELLS,
    MAX_BELOW_FLOOR_M,
    SemanticMap,
)
from gslts.types import Bools, Floats

SIDE_M = 30.0
"""Default edge of the square around the start that is explored, m. Bounds time and memory."""
MIN_DEPTH_M, MAX_DEPTH_M = 0.3, 4.0
"""Range of depths that tell floor from obstacles, m."""
SAMPLED_COLUMNS = 320
"""Number of columns to which depth is subsampled: rows of the floor at 3 m are about 5 cm apart."""
FLOOR_TOLERANCE_M, FLOOR_TOLERANCE_SHARE = 0.03, 0.01
"""Maximum height of points of the floor above what the robot climbs: m, and per m of depth, as a
pose that errs by half a degree raises what is farther by more."""
MIN_OBSTACLE_POINTS = 4
"""Minimum number of points of an obstacle in a cell of one image; fewer are noise at an edge."""
MAX_STEP_M = 0.5
"""Maximum distance of two frames between which the robot drove in a straight line; from farther, it
was carried."""
MAX_EVIDENCE = 3
"""Maximum number of images by which a cell is free or occupied: after as many others, as when a
person has passed, it changes."""


class ObservedFloor:
    """Free, occupied and unknown floor around the start of a robot.

    Args:
        start: (2,) position of the robot, x and y in the world, m.
        floor_m: Height of the floor, world z, m.
        body: Size of the robot; a cell is a quarter of its radius, as in semantic maps.
        side_m: Edge of the square that is explored, m.

    Attributes:
        grid: The M x M cells.
        floor_m: Height of the floor, world z, m.

    Raises:
        ValueError: The square has too many cells.
    """

    def __init__(
        self, start: Floats, floor_m: float, body: RobotBody, side_m: float = SIDE_M
    ) -> None:
        cell_m = body.radius_m / CELLS_PER_RADIUS
        self.grid = Grid.around(start - side_m / 2, start + side_m / 2, cell_m, 0.0)
        self.floor_m, self._body = floor_m, body
        shape = (self.grid.size, self.grid.size)
        # Number of images that show an obstacle, less those that show the floor.
        self._evidence, self._seen = np.zeros(shape, np.int8), np.zeros(shape, np.bool_)
        self._driven = np.zeros(shape, np.uint8)
        self._last: Floats | None = None

    def add(self, frame: RgbdFrame) -> None:
        """Add what a frame shows; a frame with a fault changes nothing.

        Args:
            frame: With depth, at the pose that the robot believes: the floor below it is free.
        """
        if frame.fault is not None:
            return
        points, depths = depth_points(frame, SAMPLED_COLUMNS, MIN_DEPTH_M, MAX_DEPTH_M)
        heights = points[:, 2] - self.floor_m
        tolerance_m = FLOOR_TOLERANCE_M + FLOOR_TOLERANCE_SHARE * depths
        is_level = heights <= self._body.step_m + tolerance_m
        is_obstacle = ~is_level & (heights < self._body.height_m)
        is_floor = is_level & (heights >= -MAX_BELOW_FLOOR_M)
        counts = self.grid.sums(points[is_obstacle], np.ones(int(is_obstacle.sum())))
        obstacles = counts >= MIN_OBSTACLE_POINTS
        floor = _close_gaps(self.grid.mask(points[is_floor])) & ~obstacles
        own = self.grid.cells_within(frame.camera.world_from_camera[:2, 3], self._body.radius_m)
        self._seen |= obstacles | floor | own
        self._evidence += obstacles.astype(np.int8) - floor.astype(np.int8)
        np.clip(self._evidence, -MAX_EVIDENCE, MAX_EVIDENCE, out=self._evidence)
        self._evidence[own] = -MAX_EVIDENCE
        self._drive_to(frame.camera.world_from_camera[:2, 3])

    def assume_free(self, position: Floats, radius_m: float) -> None:
        """Take the unknown cells around a position for free, such as those too near to be seen.

        Args:
            position: (2,) x and y in the world, m.
            radius_m: Of the circle, m.
        """
        self._seen |= self.grid.cells_within(position, radius_m)

    @property
    def driven(self) -> Bools:
        """Cells [M,M] where the centre of the robot was: free, however narrow they look."""
        return self._driven > 0

    def _drive_to(self, position: Floats) -> None:
        last = self._last
        if last is None or np.linalg.norm(position - last) > MAX_STEP_M:
            last = position
        # Columns, then rows; connected by edges, as paths do not pass between diagonal cells.
        start, end = self.grid.cells(np.stack([last, position]))[:, ::-1].tolist()
        cv2.line(self._driven, start, end, color=1, lineType=cv2.LINE_4)
        self._last = position

    @property
    def semantic_map(self) -> SemanticMap:
        """Obstacles and explored floor so far, without categories."""
        layers = np.stack([self._evidence > 0, self._seen])
        return SemanticMap(self.grid, layers, (), self.floor_m)


def _close_gaps(mask: Bools) -> Bools:
    """Return a mask [M,M] without the gaps between the rows of pixels of far floor."""
    square = np.ones((CLOSING_CELLS, CLOSING_CELLS), np.uint8)
    return cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_CLOSE, square) > 0
