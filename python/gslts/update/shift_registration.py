"""Local registration of a shifted object: its motion over the floor, by all views together.

The detector knows the motion from the edges of one image at half the resolution. Here the surfaces
of the object in the map are compared with depth and colours of the frames.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from gslts.core.camera import unproject
from gslts.core.gaussian_map import GaussianMap
from gslts.core.se3 import product, rotation, transform
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.rendering.view_range import view_range_m
from gslts.types import Bools, Floats, Floats32
from gslts.update.rigid_motion import MAX_COLOR_STEP, depth_tolerance_m, project_points
from gslts.update.views import MIN_ALPHA, View

MAX_SAMPLES = 4000
"""Maximum number of points of the object per view, evenly chosen: half as many find the same motion
to about a millimetre."""
UNKNOWN_COST = 0.5
"""Cost of a point that a frame does not show, between agreement, 0, and disagreement, 1."""
FIRST_STEP_M, FIRST_STEP_RAD = 0.01, np.deg2rad(1.0)
"""First step of the search: the error of the detected motion."""
HALVINGS = 3
"""Halvings of the step, down to about half a pixel at the distance from which changes are seen."""
MAX_STEPS = 8
"""Maximum number of steps of one length; more would lead away from the detected motion."""


@dataclass(frozen=True, eq=False)
class _Samples:
    """Points of the object in one view.

    Attributes:
        view: The view.
        points: [S,3] in the map before the motion, world, m.
        colors: [S,3] rendered sRGB, 0 to 1.
    """

    view: View
    points: Floats
    colors: Floats32


def register_shift(
    gaussian_map: GaussianMap,
    rows: Bools,
    views: Sequence[View],
    motion: Floats,
    threads: int = 0,
) -> Floats:
    """Refine the motion of a shifted object: its translation over the floor, and its yaw.

    Args:
        gaussian_map: float32, as rendered in the views.
        rows: [N] bool, Gaussians of the object.
        views: Of the change.
        motion: [4,4] rigid, world, m: x_after = motion @ x_before.
        threads: 0 uses all hardware threads.

    Returns:
        [4,4] the motion with which the frames agree best, near the given one.
    """
    samples = [_sample(gaussian_map, rows, view, threads) for view in views]
    if not sum(len(own.points) for own in samples):
        return motion
    center = transform(motion, np.concatenate([own.points for own in samples]).mean(axis=0))

    def apply_correction(correction: Floats) -> Floats:
        return product(_planar_motion(correction, center), motion)

    def cost(correction: Floats) -> float:
        total, count = 0.0, 0
        for own in samples:
            total += _cost(own, apply_correction(correction))
            count += len(own.points)
        return total / count

    return apply_correction(_search(cost))


def _search(cost: Callable[[Floats], float]) -> Floats:
    """Return (3,) the x, y and yaw of a local minimum (compass search)."""
    best, best_cost = np.zeros(3), cost(np.zeros(3))
    step = np.array([FIRST_STEP_M, FIRST_STEP_M, FIRST_STEP_RAD])
    for _ in range(HALVINGS + 1):
        for _ in range(MAX_STEPS):
            trials = [best + sign * step * axis for axis in np.eye(3) for sign in (-1, 1)]
            costs = [cost(trial) for trial in trials]
            if min(costs) >= best_cost:
                break
            best_cost, best = min(costs), trials[int(np.argmin(costs))]
        step = step / 2
    return best


def _planar_motion(correction: Floats, center: Floats) -> Floats:
    """Return [4,4] a rotation about a vertical axis through a point, and a translation."""
    motion = np.eye(4)
    motion[:3, :3] = rotation(np.array([0.0, 0.0, correction[2]]))
    motion[:3, 3] = center - (motion[:3, :3] * center).sum(axis=1)
    motion[:2, 3] += correction[:2]
    return motion


def _sample(gaussian_map: GaussianMap, rows: Bools, view: View, threads: int) -> _Samples:
    """Return points of the object that the map shows in a view."""
    own_ids = gaussian_map.select(rows).ids
    drawn = gaussian_map.with_features(
        lambda ids: np.isin(ids, own_ids)[:, None].astype(np.float32)
    )
    options = RenderOptions(far_m=view_range_m(view.depth), threads=threads)
    images = Rasterizer(np.float32).forward(drawn, view.camera, options)
    own = (images.features[..., 0] > MIN_ALPHA * images.alpha) & (view.rendered_depth > 0)
    v, u = np.nonzero(own)
    chosen = np.linspace(0, len(v) - 1, min(len(v), MAX_SAMPLES)).round().astype(np.intp)
    v, u = v[chosen], u[chosen]
    pixels = np.column_stack([u + 0.5, v + 0.5])
    points = unproject(view.camera, pixels, view.rendered_depth[v, u].astype(np.float64))
    return _Samples(view, points, view.rendered_rgb[v, u])


def _cost(samples: _Samples, motion: Floats) -> float:
    """Return the sum of the disagreement of a frame with each point, 0 to 1."""
    view = samples.view
    pixels, depths_m = project_points(view.camera, transform(motion, samples.points), 0)
    column, row = pixels.T
    measured = view.depth[row, column]
    tolerance_m = depth_tolerance_m(view, depths_m)
    off = np.minimum(np.abs(measured - depths_m) / tolerance_m, 1)
    colors = view.colors[row, column]
    step = np.minimum(np.abs(colors - samples.colors).sum(axis=1) / MAX_COLOR_STEP, 1)
    cost = np.where(off < 1, (off + step) / 2, 1)
    unknown = (depths_m <= 0) | (measured <= 0) | (measured < depths_m - tolerance_m)
    return float(np.where(unknown, UNKNOWN_COST, cost).sum())
