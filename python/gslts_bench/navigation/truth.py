"""Ground truth of navigation in a simulated home: paths on the robot's grid, and goals."""

from __future__ import annotations

import heapq
from collections.abc import Iterable
from functools import cached_property

import cv2
import numpy as np

from gslts.navigation.trip import SUCCESS_DISTANCE_M
from gslts.types import Floats, Ints, Ints32
from gslts_sim.actions import GRID_M
from gslts_sim.home import Home, HomeObject
from gslts_sim.ray_scene import RayScene
from gslts_sim.robot_body import CAMERA_HEIGHT_M, HORIZON_DEG, Viewpoint, robot_camera
from gslts_sim.walkable import floor_of

MIN_SHARE = 3e-4
"""Minimum share of the pixels that show a visible object: 23 of 320 x 240."""
SIZE_PX = (160, 120)
"""Size of the rendered images that tell whether a position sees an object."""
STRIDE_M = 0.02
"""Distance of the points of a step that are checked for collisions."""
STEPS = [(1, 0), (0, 1), (1, 1), (1, -1)]
"""Steps in grid cells to four of the eight neighbours; the others are their opposites."""

Neighbours = dict[int, list[tuple[int, float]]]
"""By position: other positions, and their distances, m."""


class Truth:
    """Ground truth of one state of a home.

    Args:
        home: The state.

    Attributes:
        floor: Free floor.
        positions: [P,2] positions on the robot's grid in the largest part of the floor, x and y, m.
    """

    def __init__(self, home: Home) -> None:
        self.home = home
        self.floor = floor_of(home)
        self.positions: Floats = self.floor.grid_positions(GRID_M)
        self._scene = RayScene(home)

    def is_straight(self, start: Floats, end: Floats) -> bool:
        """Return whether the straight line between two positions (2,), x and y, m, is free.

        Args:
            start: First position (2,), m.
            end: Second position (2,), m.
        """
        count = int(np.linalg.norm(end - start) / STRIDE_M) + 2
        points = start + np.linspace(0, 1, count)[:, None] * (end - start)
        return all(self.floor.is_free(point) for point in points)

    @cached_property
    def neighbours(self) -> Neighbours:
        """Neighbours of each position with a free straight line, of eight at most."""
        numbers = {tuple(cell): k for k, cell in enumerate(self._cells.tolist())}
        result: Neighbours = {k: [] for k in range(len(self.positions))}
        for (column, row), k in numbers.items():
            for i, j in STEPS:
                other = numbers.get((column + i, row + j))
                if other is not None and self.is_straight(self.positions[k], self.positions[other]):
                    metres = float(np.hypot(i, j)) * GRID_M
                    result[k].append((other, metres))
                    result[other].append((k, metres))
        return result

    @property
    def _cells(self) -> Ints:
        cells: Ints = np.rint(self.positions / GRID_M).astype(np.int64)
        return cells

    def metres_to(self, goals: Iterable[int]) -> Floats:
        """Compute shortest paths over the eight neighbours (Dijkstra).

        Args:
            goals: Numbers of positions.

        Returns:
            [P] length of the path from each position to the nearest goal, m; infinite without one.
        """
        metres = np.full(len(self.positions), np.inf)
        heap = [(0.0, goal) for goal in goals]
        metres[[goal for _, goal in heap]] = 0
        while heap:
            far, position = heapq.heappop(heap)
            if far > metres[position]:
                continue
            for other, step in self.neighbours[position]:
                if far + step < metres[other] - 1e-9:
                    metres[other] = far + step
                    heapq.heappush(heap, (far + step, other))
        return metres

    def goals(self, category: str) -> list[int]:
        """Return the numbers of the positions within 1 m of an object of a category that see it.

        Args:
            category: Type of object.
        """
        found = set()
        for row, known in enumerate(self.home.objects):
            if known.type == category:
                near = np.flatnonzero(
                    floor_distances_m(known, self.positions) <= SUCCESS_DISTANCE_M
                )
                found |= {int(k) for k in near if self._sees(self.positions[k], row)}
        return sorted(found)

    def _sees(self, position: Floats, row: int) -> bool:
        low, high = self.home.objects[row].box_in_world
        x, y, z = ((low + high) / 2).tolist()
        eye_m = float(self.home.space.box[0, 2]) + CAMERA_HEIGHT_M
        yaw_deg = float(np.rad2deg(np.arctan2(y - position[1], x - position[0])))
        down_deg = float(
            np.rad2deg(np.arctan2(eye_m - z, np.hypot(x - position[0], y - position[1])))
        )
        viewpoint = Viewpoint.at(position, yaw_deg, float(np.clip(down_deg, *HORIZON_DEG)))
        rows, _ = self._scene.instances(robot_camera(self.home, viewpoint, SIZE_PX))
        return bool((rows == row).mean() >= MIN_SHARE)


def floor_distances_m(known: HomeObject, positions: Floats) -> Floats:
    """Compute distances along the floor to the convex hull of an object, seen from above.

    Args:
        known: The object.
        positions: [K,2] x and y, m.

    Returns:
        [K] distances, m; 0 inside of it.
    """
    rotation, middle = known.world_from_object[:3, :3], known.world_from_object[:3, 3]
    vertices = np.concatenate([surface.vertices for surface in known.surfaces])
    in_world = vertices @ rotation.T + middle
    hull = cv2.convexHull(in_world[:, :2].astype(np.float32))
    metres = [-cv2.pointPolygonTest(hull, (float(x), float(y)), True) for x, y in positions]
    return np.asarray(np.maximum(metres, 0), np.float64)


def succeeds(truth: Truth, category: str, position: Floats, instances: Ints32) -> bool:
    """Return whether an object of a category is in an image and within 1 m.

    Args:
        truth: Ground truth of the home.
        category: The category.
        position: (2,) true position of the robot, m.
        instances: [H,W] true rows of the objects in its image.
    """
    return any(
        known.type == category
        and (instances == row).mean() >= MIN_SHARE
        and floor_distances_m(known, position[None])[0] <= SUCCESS_DISTANCE_M
        for row, known in enumerate(truth.home.objects)
    )
