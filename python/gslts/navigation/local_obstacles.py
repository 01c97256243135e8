"""Obstacles that a robot sees on its way and that its map does not have."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from gslts.core.frame import RgbdFrame
from gslts.core.robot_body import RobotBody
from gslts.core.se3 import transform
from gslts.navigation.semantic_map import SemanticMap

Mask = NDArray[np.bool_]

FROM_M, TO_M = 0.3, 2.0
"""Range in which depth is exact enough to tell a thing from the floor."""
LIFT_M = 0.08
"""So far above the step that a robot climbs: a camera that errs by half a degree lifts the floor by
2 cm at 2 m."""
LEAST_POINTS = 6
"""Points in a cell, of a picture with about `COLUMNS` columns."""
COLUMNS = 160
NEXT_TO = 5
"""Side, in cells, of the square around known obstacles in which nothing new is looked for: they are
rough themselves."""


def detect_obstacles(
    frame: RgbdFrame, semantic_map: SemanticMap, known: Mask, body: RobotBody
) -> Mask:
    """[M,M] cells in which a frame shows an obstacle that is not known.

    Args:
        frame: At the pose that the robot believes.
        semantic_map: Whose cells are meant.
        known: [M,M] obstacles that are known.
        body: Of the robot.
    """
    whole = frame.registered()
    camera, step = whole.camera, max(1, whole.camera.width // COLUMNS)
    depth = whole.depth[::step, ::step].astype(np.float64)
    rows, columns = np.indices(depth.shape) * step
    rays = np.stack(
        [
            (columns + 0.5 - camera.cx) / camera.fx,
            (rows + 0.5 - camera.cy) / camera.fy,
            np.ones(depth.shape),
        ],
        axis=-1,
    )
    measured = (depth > FROM_M) & (depth < TO_M)
    in_camera = rays[measured] * depth[measured, None]
    points = transform(camera.world_from_camera, in_camera)
    heights = points[:, 2] - semantic_map.floor_m
    in_the_way = (heights > body.step_m + LIFT_M) & (heights < body.height_m)
    grid = semantic_map.grid
    counts = grid.sums(points[in_the_way], np.ones(int(in_the_way.sum())))
    around = cv2.dilate(known.astype(np.uint8), np.ones((NEXT_TO, NEXT_TO), np.uint8))
    fresh: Mask = (counts >= LEAST_POINTS) & semantic_map.explored & (around == 0)
    return fresh
