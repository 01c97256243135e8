"""View planning: a small set of viewpoints from which a robot sees all of a home.

Source: greedy maximum coverage, Nemhauser, Wolsey and Fisher 1978.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable

import numpy as np

from gslts._core.sim import pixel_rays
from gslts.types import Floats, Ints
from gslts_sim.actions import GRID_M
from gslts_sim.home import Home
from gslts_sim.ray_scene import RayScene
from gslts_sim.robot_body import Viewpoint, robot_camera
from gslts_sim.walkable import floor_of

CELL_M = 0.1
"""Edge of the cells that surfaces are divided into, m; coverage is counted in cells."""
SURFACE_M = 0.01
"""Distance by which hits are moved towards the camera before they are assigned to cells, m. Floors
and walls lie on boundaries of cells, where rounding would split each into two layers of cells."""
VIEWS_PER_CELL = 3
"""Number of views that each cell needs, so that each surface is seen from several sides."""
RANGE_M = 5.0
"""Maximum depth at which a surface counts as seen, m; within the range of depth cameras."""
COMPLETE_FRACTION = 0.95
"""Fraction of the views needed by all cells at which the search ends; the rest costs many
frames."""
TURNS = 12
"""Number of yaw angles of the candidates at each position."""
HORIZONS_DEG = (0.0, 30.0)
"""Horizon angles of the candidates, degrees."""
SIZE_PX = (32, 24)
"""Width and height of the depth images of the candidates, px."""

Progress = Callable[[list[Floats]], Iterable[Floats]]


def viewpoints_in(
    home: Home, types: Iterable[str], viewpoints: Iterable[Viewpoint]
) -> list[Viewpoint]:
    """Select the viewpoints that stand in some rooms.

    Args:
        home: Of the viewpoints.
        types: Types of the rooms.
        viewpoints: To select from.

    Raises:
        ValueError: The home has no such room.
    """
    boxes = []
    for wanted in types:
        own = [room.box for room in home.rooms if room.type == wanted]
        if not own:
            known = ", ".join(sorted({room.type for room in home.rooms}))
            raise ValueError(f"{home.name}: it has no room {wanted!r}; it has {known}")
        boxes += own
    return [
        viewpoint
        for viewpoint in viewpoints
        if any(
            (
                (low[:2] <= (viewpoint.x, viewpoint.y)) & ((viewpoint.x, viewpoint.y) <= high[:2])
            ).all()
            for low, high in boxes
        )
    ]


def explore(home: Home, max_views: int, progress: Progress = list) -> tuple[list[Viewpoint], float]:
    """Select viewpoints that cover a home, in the order of a short path.

    Args:
        home: The planner knows its shape; who records the views does not.
        max_views: Maximum number of viewpoints.
        progress: Wraps the list of candidate positions, such as a progress bar.

    Returns:
        The viewpoints, and the fraction of the views needed by all cells that they give.
    """
    candidates, cells = _candidates(home, progress)
    needed = np.minimum(np.bincount(np.concatenate(cells)), VIEWS_PER_CELL)
    total, left = int(needed.sum()), needed.copy()
    # Lazy greedy: gains only shrink, so an up-to-date gain above all old ones is the maximum.
    heap = [(-len(seen), row) for row, seen in enumerate(cells)]
    heapq.heapify(heap)
    chosen: list[int] = []
    while heap and len(chosen) < max_views and left.sum() > (1 - COMPLETE_FRACTION) * total:
        _, row = heapq.heappop(heap)
        gain = int((left[cells[row]] > 0).sum())
        if heap and gain < -heap[0][0]:
            heapq.heappush(heap, (-gain, row))
            continue
        chosen.append(row)
        left[cells[row]] = np.maximum(left[cells[row]] - 1, 0)
    return _short_path([candidates[row] for row in chosen]), 1 - float(left.sum()) / total


def _candidates(home: Home, progress: Progress) -> tuple[list[Viewpoint], list[Ints]]:
    """Return candidate viewpoints, and for each the numbers of the cells that it sees."""
    scene = RayScene(home)
    viewpoints, cells = [], []
    for position in progress(list(floor_of(home).grid_positions(GRID_M))):
        for turn in range(TURNS):
            for horizon_deg in HORIZONS_DEG:
                viewpoints.append(Viewpoint.at(position, 360.0 / TURNS * turn, horizon_deg))
                cells.append(_cells_seen(home, scene, viewpoints[-1]))
    lowest = np.min([seen.min(axis=0) for seen in cells if len(seen)], axis=0)
    highest = np.max([seen.max(axis=0) for seen in cells if len(seen)], axis=0)
    size = tuple(highest - lowest + 1)
    keys = [np.unique(np.ravel_multi_index(tuple((seen - lowest).T), size)) for seen in cells]
    numbers = np.unique(np.concatenate(keys))
    return viewpoints, [np.searchsorted(numbers, key) for key in keys]


def _cells_seen(home: Home, scene: RayScene, viewpoint: Viewpoint) -> Ints:
    """Return the cells [K,3] that the rays of a view hit."""
    rays = pixel_rays(robot_camera(home, viewpoint, SIZE_PX), threads=0)
    depth = scene.cast(rays).distances
    hit = depth < RANGE_M
    points = rays[hit, :3] + rays[hit, 3:] * (depth[hit, None] - np.float32(SURFACE_M))
    cells: Ints = np.floor(points / CELL_M).astype(np.int64)
    return cells


def _short_path(viewpoints: list[Viewpoint]) -> list[Viewpoint]:
    """Return the viewpoints, each followed by the nearest of the rest."""
    left = sorted(viewpoints, key=lambda view: (view.x, view.y, view.yaw_deg, view.horizon_deg))
    path = left[:1]
    left = left[1:]
    while left:
        here = path[-1].position
        metres = [float(np.linalg.norm(view.position - here)) for view in left]
        path.append(left.pop(int(np.argmin(metres))))
    return path
