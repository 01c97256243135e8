"""New Gaussians of a fit that are errors."""

import tracemalloc
from types import SimpleNamespace

import numpy as np
import pytest
from store_maps import random_map

from gslts.change.visibility import VisibilityCounts
from gslts.extension import grow

GAUSSIANS, FRAMES = 5000, 200


class Blind:
    """Training cameras that saw none of the points; notes the distances of these."""

    has_cameras = True

    def __init__(self) -> None:
        self.near_m = np.empty(0)

    def counts(self, points: np.ndarray, near_m: np.ndarray) -> VisibilityCounts:
        self.near_m = near_m
        nothing = np.zeros(len(points), np.int64)
        return VisibilityCounts(nothing, nothing)


def test_the_distance_of_the_nearest_frame_takes_no_memory_per_frame(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(grow, "max_weights", lambda *_: np.ones(GAUSSIANS))
    gaussians = random_map(GAUSSIANS)
    optimizer = SimpleNamespace(
        adam=SimpleNamespace(map=gaussians), config=SimpleNamespace(threads=1), observations=[]
    )
    frames = []
    for x in range(FRAMES):
        pose = np.eye(4)
        pose[0, 3] = x
        frames.append(SimpleNamespace(world_from_camera=pose))
    visibility = Blind()
    tracemalloc.start()
    try:
        fitted = grow._without_errors(optimizer, frames, visibility, 0)
        assert tracemalloc.get_traced_memory()[1] < GAUSSIANS * FRAMES
    finally:
        tracemalloc.stop()
    assert fitted.size == GAUSSIANS
    points = gaussians.means + gaussians.origin
    nearest = points - np.column_stack(
        [points[:, 0].round().clip(0, FRAMES - 1), np.zeros((GAUSSIANS, 2))]
    )
    np.testing.assert_allclose(visibility.near_m, np.linalg.norm(nearest, axis=1), rtol=1e-6)
