"""The quality of the depth of a frame."""

import numpy as np
import pytest

from gslts.change.depth_quality import depth_quality, depth_quantum_m


def slanted_wall() -> np.ndarray:
    """Return [120,160] depths from 1 to 3 m, m."""
    return np.tile(np.linspace(1, 3, 160, dtype=np.float32), (120, 1))


@pytest.mark.parametrize("step_m", [0.001, 0.02, 0.04])
def test_the_step_of_rounded_depths_is_found(step_m: float) -> None:
    depth = (np.round(slanted_wall() / step_m) * step_m).astype(np.float32)
    assert depth_quantum_m(depth) == pytest.approx(max(step_m, 2 / 159), rel=0.05)


def test_pixels_without_depth_do_not_count() -> None:
    depth = (np.round(slanted_wall() / 0.04) * 0.04).astype(np.float32)
    depth[:40] = 0
    depth[40:60] = np.nan
    assert depth_quantum_m(depth) == pytest.approx(0.04, rel=0.05)


@pytest.mark.parametrize("values", [[], [1.0], [1.0, 2.0, 3.0]])
def test_few_distinct_depths_tell_no_step(values: list[float]) -> None:
    depth = np.zeros((60, 80), np.float32)
    for row, value in enumerate(values):
        depth[10 * row : 10 * row + 10] = value
    assert depth_quantum_m(depth) == 0


@pytest.mark.parametrize(("step_m", "expected"), [(0.001, "fine"), (0.04, "coarse")])
def test_large_steps_make_depth_coarse(step_m: float, expected: str) -> None:
    depth = (np.round(slanted_wall() / step_m) * step_m).astype(np.float32)
    assert depth_quality(depth) == expected


def test_the_depth_of_no_pixel_is_none() -> None:
    assert depth_quality(np.zeros(0, np.float32)) == "none"


@pytest.mark.parametrize("missing", [0.0, np.nan])
def test_hardly_any_depth_is_none(missing: float) -> None:
    depth = np.full((60, 80), missing, np.float32)
    depth[:5] = slanted_wall()[:5, :80]
    assert depth_quality(depth) == "none"
