"""Viewpoints from which a robot sees all of a map, and a short path through them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from gslts.change.visibility import Visibility
from gslts.core.camera import Camera
from gslts.core.gaussian_map import GaussianMap
from gslts.robots.driving import short_path

MAX_POINTS = 4000
"""Approximate number of Gaussians that represent the map."""
MIN_OPACITY = 0.5
"""Minimum opacity of a Gaussian that counts as a surface."""
MAX_DEPTH_M = 2.5
"""Maximum depth at which a viewpoint covers a surface, m: farther away, a cup has too few pixels to
be detected."""
MIN_COVERAGE = 0.95
"""Share of the visible surfaces that a round must cover."""


def plan_viewpoints(
    gaussian_map: GaussianMap, cameras: Mapping[str, Camera], max_viewpoints: int, threads: int = 0
) -> tuple[str, ...]:
    """Choose viewpoints that cover a map.

    Args:
        gaussian_map: float32.
        cameras: Training cameras of the map by name, at least one: a robot can stand there.
        max_viewpoints: Maximum number of viewpoints.
        threads: 0 uses all hardware threads.

    Returns:
        Names of the viewpoints in the order of a short path.

    Raises:
        ValueError: There is no camera.

    Source: greedy maximum coverage, Nemhauser, Wolsey and Fisher 1978.
    """
    if not cameras:
        raise ValueError("plan_viewpoints: cameras: the map has no training cameras")
    names = list(cameras)
    min_logit = float(np.log(MIN_OPACITY / (1 - MIN_OPACITY)))
    solid = np.flatnonzero(gaussian_map.logit_opacities > min_logit)
    rows = solid[:: max(1, len(solid) // MAX_POINTS)]
    points = gaussian_map.means[rows] + gaussian_map.origin
    visible = Visibility(gaussian_map, cameras.values(), threads).visible(points, MAX_DEPTH_M)
    uncovered = visible.any(axis=0)
    enough = (1 - MIN_COVERAGE) * uncovered.sum()
    chosen: list[int] = []
    while len(chosen) < max_viewpoints and uncovered.sum() > enough:
        chosen.append(int(np.argmax((visible & uncovered).sum(axis=1))))
        uncovered &= ~visible[chosen[-1]]
    first, *others = [names[row] for row in chosen or [0]]
    poses = np.array([cameras[name].world_from_camera for name in others]).reshape(-1, 4, 4)
    return first, *(others[row] for row in short_path(poses, cameras[first].world_from_camera))
