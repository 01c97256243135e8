"""What is true of navigation in a simulated home: ways on the robot's grid, and goals."""

from __future__ import annotations

import heapq
from collections.abc import Iterable
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from gslts.navigation.navigator import SUCCESS_DISTANCE_M
from gslts.types import Floats
from gslts_sim.actions import GRID_M
from gslts_sim.home import Home, HomeObject
from gslts_sim.ray_scene import RayScene
from gslts_sim.robot_body import CAMERA_HEIGHT_M, HORIZON_DEG, Viewpoint, floor_of, robot_camera

LEAST_SHARE = 3e-4
"""Share of the pixels of a picture that must show an object: 23 of 320 x 240."""
SIZE_PX = (160, 120)
"""Of the pictures that tell whether a place sees an object."""
STRIDE_M = 0.02
"""Between points of a step at which the robot needs room."""
STEPS = [(1, 0), (0, 1), (1, 1), (1, -1)]
"""To four of the eight neighbours; the others are those back."""

Ends = dict[int, list[tuple[int, float]]]


class Truth:
    """A home as it is.

    Args:
        home: Its state.

    Attributes:
        floor: Where the robot can be.
        places: [P,2] of the robot's grid in the largest part of the floor, x and y, m.
    """

    def __init__(self, home: Home) -> None:
        self.home = home
        self.floor = floor_of(home)
        self.places: Floats = self.floor.grid_positions(GRID_M)
        self._scene = RayScene(home)

    def is_straight(self, start: Floats, end: Floats) -> bool:
        """Whether the robot can go straight from (2,) to (2,), x and y, m."""
        count = int(np.linalg.norm(end - start) / STRIDE_M) + 2
        points = start + np.linspace(0, 1, count)[:, None] * (end - start)
        return all(self.floor.is_free(point) for point in points)

    @cached_property
    def neighbours(self) -> Ends:
        """Of each place, those of the eight next to it that it can go straight to, and how far."""
        numbers = {tuple(cell): k for k, cell in enumerate(self._cells.tolist())}
        result: Ends = {k: [] for k in range(len(self.places))}
        for (column, row), k in numbers.items():
            for i, j in STEPS:
                other = numbers.get((column + i, row + j))
                if other is not None and self.is_straight(self.places[k], self.places[other]):
                    metres = float(np.hypot(i, j)) * GRID_M
                    result[k].append((other, metres))
                    result[other].append((k, metres))
        return result

    @property
    def _cells(self) -> NDArray[np.int64]:
        cells: NDArray[np.int64] = np.rint(self.places / GRID_M).astype(np.int64)
        return cells

    def metres_to(self, goals: Iterable[int]) -> Floats:
        """[P] shortest way from each place to the nearest of some, over the eight neighbours, m.

        Args:
            goals: Numbers of places.
        """
        metres = np.full(len(self.places), np.inf)
        heap = [(0.0, goal) for goal in goals]
        metres[[goal for _, goal in heap]] = 0
        while heap:
            far, place = heapq.heappop(heap)
            if far > metres[place]:
                continue
            for other, step in self.neighbours[place]:
                if far + step < metres[other] - 1e-9:
                    metres[other] = far + step
                    heapq.heappush(heap, (far + step, other))
        return metres

    def goals(self, category: str) -> list[int]:
        """Numbers of the places within 1 m of an object of a type from which it can be seen."""
        found = set()
        for row, thing in enumerate(self.home.objects):
            if thing.type == category:
                near = np.flatnonzero(floor_distances_m(thing, self.places) <= SUCCESS_DISTANCE_M)
                found |= {int(k) for k in near if self._sees(self.places[k], row)}
        return sorted(found)

    def _sees(self, place: Floats, row: int) -> bool:
        low, high = self.home.objects[row].box_in_world
        x, y, z = ((low + high) / 2).tolist()
        eye_m = float(self.home.space.box[0, 2]) + CAMERA_HEIGHT_M
        yaw_deg = float(np.rad2deg(np.arctan2(y - place[1], x - place[0])))
        down_deg = float(np.rad2deg(np.arctan2(eye_m - z, np.hypot(x - place[0], y - place[1]))))
        look = Viewpoint.at(place, yaw_deg, float(np.clip(down_deg, *HORIZON_DEG)))
        rows, _ = self._scene.instances(robot_camera(self.home, look, SIZE_PX))
        return bool((rows == row).mean() >= LEAST_SHARE)


def floor_distances_m(thing: HomeObject, places: Floats) -> Floats:
    """[K] along the floor, from places [K,2] to the nearest point of an object; 0 inside of it.

    Objects count as convex, seen from above.
    """
    rotation, middle = thing.world_from_object[:3, :3], thing.world_from_object[:3, 3]
    vertices = np.concatenate([surface.vertices for surface in thing.surfaces])
    in_world = vertices @ rotation.T + middle
    hull = cv2.convexHull(in_world[:, :2].astype(np.float32))
    metres = [-cv2.pointPolygonTest(hull, (float(x), float(y)), True) for x, y in places]
    return np.asarray(np.maximum(metres, 0), np.float64)


def succeeds(truth: Truth, category: str, place: Floats, instances: NDArray[np.int32]) -> bool:
    """Whether an object of a type is in a picture and within 1 m.

    Args:
        truth: Of the home.
        category: The type.
        place: (2,) where the robot is in truth, m.
        instances: [H,W] rows of the objects that its picture shows in truth.
    """
    return any(
        thing.type == category
        and (instances == row).mean() >= LEAST_SHARE
        and floor_distances_m(thing, place[None])[0] <= SUCCESS_DISTANCE_M
        for row, thing in enumerate(truth.home.objects)
    )
