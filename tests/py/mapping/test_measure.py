"""Measurements of a map by its recording."""

from dataclasses import replace

import numpy as np
import pytest

from gslts.core.camera import camera_from_fov, look_at
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.core.surface_margin import surface_margin_m
from gslts.mapping.measure import MIN_NOISE_M, fit_noise, measure_map
from gslts.store.measurements import NO_MEASUREMENTS, TYPICAL_NOISE

DEPTH_M = 2.0
ORIGIN = np.array([10.0, -5.0, 1.0])


def gaussians(*means: tuple[float, float, float]) -> GaussianMap:
    """Return Gaussians at some centres, relative to the origin of the map."""
    size = len(means)
    return GaussianMap(
        means=np.array(means, np.float32),
        quats=np.tile(np.float32([1, 0, 0, 0]), (size, 1)),
        log_scales=np.full((size, 3), -4, np.float32),
        logit_opacities=np.zeros(size, np.float32),
        sh=np.zeros((size, 1, 3), np.float32),
        ids=np.arange(5, 5 + size, dtype=np.uint64),
        origin=ORIGIN,
    )


def wall() -> GaussianMap:
    """Return an opaque grey wall at x = DEPTH_M, from -2 to 2 m."""
    side = np.arange(-2, 2, 0.05)
    y, z = (grid.ravel() for grid in np.meshgrid(side, side))
    made = gaussians(*zip(np.full(y.size, DEPTH_M), y, z, strict=True))
    scales = np.full((made.size, 3), np.log(0.04), np.float32)
    scales[:, 0] = np.log(0.001)
    return replace(made, log_scales=scales, logit_opacities=np.full(made.size, 6, np.float32))


def frame(depth_m: float = DEPTH_M, width: int = 40) -> RgbdFrame:
    """Return a frame from the origin of the map along x, of a wall at a depth."""
    pose = look_at(ORIGIN, ORIGIN + np.array([1.0, 0.0, 0.0]))
    camera = camera_from_fov(width, 3 * width // 4, 1.0, pose)
    depth = np.full((camera.height, width), depth_m, np.float32)
    return RgbdFrame(np.full((camera.height, width, 3), 128, np.uint8), depth, camera)


def unmeasured(gaussian_map: GaussianMap, *frames: RgbdFrame) -> list[int]:
    measured = measure_map(gaussian_map, frames)
    return [int(value) for value in measured.ids[~measured.is_measured]]


def test_what_depths_confirm_is_measured() -> None:
    margin_m = surface_margin_m(np.array([DEPTH_M]))[0]
    made = gaussians(
        (DEPTH_M, 0, 0),
        (DEPTH_M + 0.9 * margin_m, 0.1, 0),
        (DEPTH_M - 2 * margin_m, 0, 0.1),  # In front of the wall.
        (DEPTH_M + 2 * margin_m, 0, 0),  # Behind it.
        (-1, 0, 0),  # Behind the camera.
        (DEPTH_M, 5, 0),  # Beside the image.
    )
    assert unmeasured(made, frame()) == [7, 8, 9, 10]


def test_most_depths_decide() -> None:
    made = gaussians((DEPTH_M, 0, 0))
    through = frame(2 * DEPTH_M)
    occluded = frame(DEPTH_M / 2)  # Says nothing of what is behind.
    assert unmeasured(made, frame(), through, occluded) == []
    assert unmeasured(made, frame(), through, through) == [5]


def test_where_no_depth_is_measured_nothing_is_confirmed() -> None:
    made = gaussians((DEPTH_M, 0.5, 0), (DEPTH_M, -0.5, 0))
    half = frame()
    depth = half.depth.copy()
    depth[:, 20:] = np.nan  # The image's right is at -y.
    assert unmeasured(made, replace(half, depth=depth)) == [6]
    assert measure_map(made, [frame(0.0)]) is NO_MEASUREMENTS  # Photographs tell nothing.


def test_errors_are_those_of_the_rendered_images() -> None:
    made = wall()
    seen = frame(DEPTH_M + 0.02, 160)
    rgb = seen.rgb.copy()
    rgb[::2] += 26  # The exposure explains the mean, not the stripes of +-13.
    measured = measure_map(made, [replace(seen, rgb=rgb)])
    known = np.isfinite(measured.errors).all(axis=1)
    assert 0.2 < known.mean() < 0.9  # The view covers a part of the wall.
    assert np.isnan(measured.errors[~known]).all()
    assert np.median(measured.errors[known, 0]) == pytest.approx(0.02, abs=2e-3)
    assert np.median(measured.errors[known, 1]) < 0.02  # Halving averages the stripes.
    columns = seen.rgb.copy()
    columns[:, 80:] += 52
    errors = measure_map(made, [replace(seen, rgb=columns)]).errors[:, 1]
    assert np.nanmedian(errors) == pytest.approx(3 * 26 / 255, rel=0.1)


@pytest.mark.parametrize(("constant_m", "per_m"), [(0.005, 0.0012), (0.02, 0.0), (0.01, 0.004)])
def test_the_noise_of_depth_is_found(constant_m: float, per_m: float) -> None:
    rng = np.random.default_rng(1)
    depths = rng.uniform(0.5, 5, 40_000).astype(np.float32)
    differences = rng.normal(0, constant_m + per_m * depths**2).astype(np.float32)
    differences[::20] = 0.3  # Outliers, such as edges.
    found = fit_noise(depths, differences)
    assert found[0] == pytest.approx(constant_m, abs=0.15 * constant_m + 1e-3)
    assert found[1] == pytest.approx(per_m, abs=0.15 * per_m + 1e-4)


def test_noise_has_a_floor_and_needs_samples() -> None:
    depths = np.linspace(0.5, 5, 5000, dtype=np.float32)
    assert fit_noise(depths, np.zeros_like(depths)) == (MIN_NOISE_M, 0.0)
    assert fit_noise(np.full_like(depths, 2.0), np.full_like(depths, 0.01))[1] == 0.0
    assert fit_noise(depths[:100], depths[:100]) == TYPICAL_NOISE
