"""Free floor of the newest version of a map."""

from __future__ import annotations

import numpy as np

from gslts.core.gaussian_map import GaussianMap
from gslts.core.robot_body import RobotBody
from gslts.navigation.planner import free_cells
from gslts.navigation.semantic_map import SemanticMap, make_semantic_map
from gslts.types import Floats


class FreeFloor:
    """Computes the semantic map of a version once.

    Args:
        body: Size of the robot.
    """

    def __init__(self, body: RobotBody) -> None:
        self._body = body
        self._made: tuple[GaussianMap, SemanticMap] | None = None

    def semantic_map(self, gaussian_map: GaussianMap) -> SemanticMap:
        """Return obstacles and explored floor of a map.

        Args:
            gaussian_map: float32.

        Raises:
            ValueError: No Gaussian is opaque.
        """
        if self._made is None or self._made[0] is not gaussian_map:
            self._made = gaussian_map, make_semantic_map(gaussian_map, self._body)
        return self._made[1]

    def positions(self, gaussian_map: GaussianMap) -> Floats:
        """Return [P,2] centres of the cells where the robot fits, x and y in the map, m.

        Args:
            gaussian_map: float32.

        Raises:
            ValueError: No Gaussian is opaque.
        """
        semantic_map = self.semantic_map(gaussian_map)
        grid, radius_m = semantic_map.grid, self._body.radius_m
        free = free_cells(semantic_map.explored, semantic_map.obstacles, radius_m / grid.cell_m)
        return grid.centers(np.argwhere(free))
