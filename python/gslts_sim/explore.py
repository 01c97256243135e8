"""Which views of a home a robot must take to see all of it that can be seen."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable

import numpy as np
from numpy.typing import NDArray

from gslts._core.sim import pixel_rays
from gslts.types import Floats
from gslts_sim.actions import GRID_M
from gslts_sim.home import Home
from gslts_sim.ray_scene import RayScene
from gslts_sim.robot_body import Viewpoint, floor_of, robot_camera

CELL_M = 0.1
"""A surface is covered when each cell of this size that it passes through is."""
VIEWS_PER_CELL = 3
"""Views that each cell needs, so that each surface is seen from several sides."""
RANGE_M = 5.0
"""Farther surfaces do not count as seen."""
COMPLETE_SHARE = 0.95
TURNS = 12
HORIZONS_DEG = (0.0, 30.0)
SIZE_PX = (32, 24)

Progress = Callable[[list[Floats]], Iterable[Floats]]


def explore(home: Home, most: int, progress: Progress = list) -> tuple[list[Viewpoint], float]:
    """Views that cover a home, in the order of a short way.

    Args:
        home: Whose shape is known to the planner, but not to who gets the pictures.
        most: Views at most.
        progress: Shows how far it is; takes and returns the places that are looked from.

    Returns:
        The looks, and the share of the views that the cells need which they give.

    Source: greedy maximum coverage, Nemhauser, Wolsey and Fisher 1978.
    """
    looks, cells = _candidates(home, progress)
    seen = np.bincount(np.concatenate(cells))
    needed = np.minimum(seen, VIEWS_PER_CELL)
    total, left = int(needed.sum()), needed.copy()
    # Gains only shrink, so that the best of old gains that holds is the best of all.
    heap = [(-len(of_look), row) for row, of_look in enumerate(cells)]
    heapq.heapify(heap)
    chosen: list[int] = []
    while heap and len(chosen) < most and left.sum() > (1 - COMPLETE_SHARE) * total:
        _, row = heapq.heappop(heap)
        gain = int((left[cells[row]] > 0).sum())
        if heap and gain < -heap[0][0]:
            heapq.heappush(heap, (-gain, row))
            continue
        chosen.append(row)
        left[cells[row]] = np.maximum(left[cells[row]] - 1, 0)
    return _short_way([looks[row] for row in chosen]), 1 - float(left.sum()) / total


def _candidates(home: Home, progress: Progress) -> tuple[list[Viewpoint], list[NDArray[np.intp]]]:
    """All views that are thought of, and for each the numbers of the cells that it sees."""
    scene = RayScene(home)
    looks, cells = [], []
    for place in progress(list(floor_of(home).grid_positions(GRID_M))):
        for turn in range(TURNS):
            for horizon_deg in HORIZONS_DEG:
                looks.append(Viewpoint.at(place, 360.0 / TURNS * turn, horizon_deg))
                cells.append(_cells_seen(home, scene, looks[-1]))
    lowest = np.min([of_look.min(axis=0) for of_look in cells if len(of_look)], axis=0)
    highest = np.max([of_look.max(axis=0) for of_look in cells if len(of_look)], axis=0)
    size = highest - lowest + 1
    keys = [
        np.unique(np.ravel_multi_index(tuple((of_look - lowest).T), tuple(size)))
        for of_look in cells
    ]
    numbers = np.unique(np.concatenate(keys))
    return looks, [np.searchsorted(numbers, key) for key in keys]


def _cells_seen(home: Home, scene: RayScene, look: Viewpoint) -> NDArray[np.int64]:
    """[K,3] the cells that a look hits."""
    camera = robot_camera(home, look, SIZE_PX)
    rays = pixel_rays(camera, threads=0)
    depth = scene.cast(rays).distances
    hit = depth < RANGE_M
    points = rays[hit, :3] + rays[hit, 3:] * depth[hit, None]
    cells: NDArray[np.int64] = np.floor(points / CELL_M).astype(np.int64)
    return cells


def _short_way(looks: list[Viewpoint]) -> list[Viewpoint]:
    """The same looks, each followed by the nearest of the rest; at one place, in turn."""
    left = sorted(looks, key=lambda look: (look.x, look.y, look.yaw_deg, look.horizon_deg))
    way = left[:1]
    left = left[1:]
    while left:
        here = way[-1]
        metres = [float(np.linalg.norm(look.position - here.position)) for look in left]
        way.append(left.pop(int(np.argmin(metres))))
    return way
