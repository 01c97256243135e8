"""Detection of obstacles in a depth image that the map does not have."""

from __future__ import annotations

import cv2
import numpy as np

from gslts.core.camera import unproject
from gslts.core.frame import RgbdFrame
from gslts.core.robot_body import RobotBody
from gslts.navigation.semantic_map import SemanticMap
from gslts.types import Bools, Floats

MIN_DEPTH_M, MAX_DEPTH_M = 0.3, 2.0
"""Range of depths that are accurate enough to tell an obstacle from the floor."""
HEIGHT_MARGIN_M = 0.08
"""Minimum height of an obstacle above the step that the robot climbs. A camera pose that errs by
half a degree raises the floor by 2 cm at 2 m."""
MIN_POINTS = 6
"""Minimum number of points of an obstacle in a cell, in an image sampled at about
`SAMPLED_COLUMNS`."""
SAMPLED_COLUMNS = 160
"""Number of columns to which depth is subsampled; bounds time."""
KNOWN_MARGIN_CELLS = 5
"""Side of the square around a known obstacle in which no new one is detected: outlines of obstacles
in the map are inaccurate by about two cells."""


def detect_obstacles(
    frame: RgbdFrame, semantic_map: SemanticMap, known: Bools, body: RobotBody
) -> Bools:
    """Detect obstacles in a frame that are not known yet.

    Args:
        frame: With depth, at the pose that the robot believes.
        semantic_map: Gives the grid, the explored cells and the height of the floor.
        known: [M,M] bool, known obstacles.
        body: Size of the robot.

    Returns:
        [M,M] bool, cells with new obstacles.
    """
    points, _ = depth_points(frame, SAMPLED_COLUMNS, MIN_DEPTH_M, MAX_DEPTH_M)
    heights = points[:, 2] - semantic_map.floor_m
    is_obstacle = (heights > body.step_m + HEIGHT_MARGIN_M) & (heights < body.height_m)
    counts = semantic_map.grid.sums(points[is_obstacle], np.ones(int(is_obstacle.sum())))
    near_known = cv2.dilate(
        known.astype(np.uint8), np.ones((KNOWN_MARGIN_CELLS, KNOWN_MARGIN_CELLS), np.uint8)
    )
    new: Bools = (counts >= MIN_POINTS) & semantic_map.explored & (near_known == 0)
    return new


def depth_points(
    frame: RgbdFrame, columns: int, min_depth_m: float, max_depth_m: float
) -> tuple[Floats, Floats]:
    """Compute the points that the depth of a frame shows.

    Args:
        frame: With depth, at the pose that the robot believes.
        columns: Number of columns to which depth is subsampled, at most; bounds time.
        min_depth_m: Depths up to here are ignored, m.
        max_depth_m: Depths from here on are ignored, m.

    Returns:
        [P,3] points in the world, m, and [P] their depths, m.
    """
    registered = frame.registered()
    step = max(1, registered.camera.width // columns)
    depth = registered.depth[::step, ::step].astype(np.float64)
    measured = (depth > min_depth_m) & (depth < max_depth_m)
    rows, at = np.nonzero(measured)
    depths: Floats = depth[measured]
    pixels = step * np.column_stack([at, rows]).astype(np.float64) + 0.5
    return unproject(registered.camera, pixels, depths), depths
