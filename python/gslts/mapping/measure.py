"""Measures a map against its recording: which Gaussians depths confirm, and the errors of each."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import GaussianMap
from gslts.core.surface_margin import surface_margin_m
from gslts.mapping.observation import Observation
from gslts.rendering.losses import apply_exposure, fit_exposure
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.store.measurements import (
    NO_MEASUREMENTS,
    TYPICAL_NOISE,
    Measurements,
)
from gslts.store.recorded_depths import RecordedDepths, small_depth_image
from gslts.types import Bools, Floats, Floats32, Indices, Ints

MEASURING_FRAMES = 200
"""About the number of training frames that the map is compared with: each takes 20 ms for 100,000
Gaussians."""
MIN_CONFIRMED_SHARE = 0.5
"""Minimum share of the depths measured at a Gaussian, or behind it, that are at it."""
MIN_ALPHA = 0.8
"""Minimum alpha of a pixel whose error counts: beside it the map is not covered."""
MAX_ERROR_M = 0.3
"""Maximum error of a depth; more is another surface, not noise."""
MAX_SLOPE = 0.02
"""Maximum change of the rendered depth from pixel to pixel, as a share of it, where the noise is
measured: not at edges."""
NOISE_BINS, NOISE_STRIDE = 8, 7
"""Number of bins of the depth, each with as many samples, and stride of the pixels sampled."""
MIN_NOISE_SAMPLES = 100
"""Minimum number of samples of a bin."""
MIN_NOISE_M = 0.005
"""Minimum constant part of the noise: with less, bumps of a map become surfaces. Fits give 2.7 to
5.2 mm in simulated homes, and 7.6 mm in a real room."""
SIGMA_OF_MEDIAN = 1.4826
"""Standard deviation of a normal distribution over its median magnitude."""


def measure_map(
    gaussian_map: GaussianMap, frames: Iterable[RgbdFrame], threads: int = 0
) -> Measurements:
    """Compare a map with frames of its recording.

    Args:
        gaussian_map: float32, map of the frames.
        frames: At their poses in the map.
        threads: Number of threads; 0 means one per hardware thread.

    Returns:
        The measurements; none if no frame has a depth.
    """
    counts, errors = _Counts(gaussian_map), _Errors(gaussian_map, threads)
    images = []
    for frame in frames:
        registered = frame.registered()
        images.append(small_depth_image(registered))
        counts.add(registered)
        errors.add(registered.halved())
    if not counts.confirmed.any():
        return NO_MEASUREMENTS
    confirmed, passed = counts.confirmed, counts.passed
    is_measured: Bools = confirmed >= np.maximum(1, MIN_CONFIRMED_SHARE * (confirmed + passed))
    order = np.argsort(gaussian_map.ids)
    cameras, depths_mm = zip(*images, strict=True)
    return Measurements(
        gaussian_map.ids[order],
        is_measured[order],
        errors.means()[order],
        errors.noise(),
        RecordedDepths(cameras, np.concatenate(depths_mm)),
    )


def measure_recording(
    gaussian_map: GaussianMap, frames: Sequence[Observation], threads: int = 0
) -> Measurements:
    """Compare a map with about `MEASURING_FRAMES` frames of its recording; see `measure_map`.

    Args:
        gaussian_map: float32, map of the frames.
        frames: At their poses in the map, in the order in which they were taken.
        threads: Number of threads; 0 means one per hardware thread.
    """
    step = max(1, len(frames) // MEASURING_FRAMES)
    return measure_map(gaussian_map, (frame.rgbd() for frame in frames[::step]), threads)


def count_measurements(gaussian_map: GaussianMap, frames: Iterable[RgbdFrame]) -> tuple[Ints, Ints]:
    """Count the frames that measured a surface at each Gaussian, and behind it.

    Args:
        gaussian_map: Map of the frames.
        frames: At their poses in the map.

    Returns:
        [N] each.
    """
    counts = _Counts(gaussian_map)
    for frame in frames:
        counts.add(frame.registered())
    return counts.confirmed, counts.passed


class _Counts:
    """Counts of the frames that confirm each Gaussian [N], and that see behind it [N]."""

    def __init__(self, gaussian_map: GaussianMap) -> None:
        self._map = gaussian_map
        self.confirmed, self.passed = np.zeros((2, gaussian_map.size), np.int64)

    def add(self, frame: RgbdFrame) -> None:
        """Count the depths of a registered frame."""
        rows, pixels, depths_m = project_centres(self._map, frame)
        measured_m = np.nan_to_num(frame.depth).ravel()[pixels].astype(np.float64)
        is_known = measured_m > 0
        rows, depths_m, measured_m = rows[is_known], depths_m[is_known], measured_m[is_known]
        margins_m = surface_margin_m(depths_m)
        self.confirmed[rows] += np.abs(measured_m - depths_m) <= margins_m
        self.passed[rows] += measured_m > depths_m + margins_m


class _Errors:
    """Sums of the errors of rendered depths and colours at each Gaussian, and their noise."""

    def __init__(self, gaussian_map: GaussianMap, threads: int) -> None:
        self._map, self._options = gaussian_map, RenderOptions(threads=threads)
        self._rasterizer = Rasterizer(np.float32)
        self._sums, self._counts = np.zeros((2, gaussian_map.size, 2))
        self._depths_m: list[Floats32] = []
        self._differences_m: list[Floats32] = []

    def add(self, frame: RgbdFrame) -> None:
        """Add the errors of a registered frame where it shows the surface of a Gaussian."""
        images = self._rasterizer.forward(self._map, frame.camera, self._options)
        known = images.alpha >= MIN_ALPHA
        if frame.mask is not None:
            known &= frame.mask
        observed_rgb = frame.rgb.astype(np.float32) / np.float32(255)
        exposure = fit_exposure(images.rgb, observed_rgb, mask=known, threads=self._options.threads)
        rendered_rgb = apply_exposure(images.rgb, exposure).clip(0, 1)
        observed_depth = np.nan_to_num(frame.depth)
        is_measured = known & (observed_depth > 0)
        difference_m = observed_depth - images.depth
        errors = np.stack(
            [
                np.where(is_measured, np.minimum(np.abs(difference_m), MAX_ERROR_M), np.nan),
                np.where(known, np.abs(rendered_rgb - observed_rgb).sum(axis=-1), np.nan),
            ],
            axis=-1,
        )
        rows, pixels, depths_m = project_centres(self._map, frame)
        surface_m = images.depth.ravel()[pixels]
        is_on = np.abs(surface_m - depths_m) <= surface_margin_m(depths_m)
        found = errors.reshape(-1, 2)[pixels[is_on]]
        self._sums[rows[is_on]] += np.nan_to_num(found)
        self._counts[rows[is_on]] += np.isfinite(found)
        slope = np.hypot(*np.gradient(images.depth))
        smooth = is_measured & (slope <= MAX_SLOPE * images.depth)
        self._depths_m.append(observed_depth[smooth][::NOISE_STRIDE])
        self._differences_m.append(difference_m[smooth][::NOISE_STRIDE])

    def means(self) -> Floats32:
        """Return the mean errors [N,2]; NaN where there are none."""
        known = self._counts > 0
        means = self._sums / np.maximum(self._counts, 1)
        return np.where(known, means, np.nan).astype(np.float32)

    def noise(self) -> tuple[float, float]:
        """Return the noise (a, b) of the depth, see `Measurements`."""
        return fit_noise(np.concatenate(self._depths_m), np.concatenate(self._differences_m))


def fit_noise(depths_m: Floats32, differences_m: Floats32) -> tuple[float, float]:
    """Fit the standard deviation a + b z^2 of differences of depths z, robustly.

    The median magnitude of the differences in bins of the depth is fitted by least squares.

    Args:
        depths_m: [S] measured depths, m.
        differences_m: [S] measured less rendered depths, m.

    Returns:
        a in m and b in 1/m; the typical ones with too few samples.
    """
    if len(depths_m) < NOISE_BINS * MIN_NOISE_SAMPLES:
        return TYPICAL_NOISE
    bins = np.array_split(np.argsort(depths_m, kind="stable"), NOISE_BINS)
    squares = [float(np.median(depths_m[rows])) ** 2 for rows in bins]
    sigmas = [SIGMA_OF_MEDIAN * float(np.median(np.abs(differences_m[rows]))) for rows in bins]
    square, sigma = math.fsum(squares) / NOISE_BINS, math.fsum(sigmas) / NOISE_BINS
    spread = math.fsum((x - square) ** 2 for x in squares)
    products = math.fsum((x - square) * (y - sigma) for x, y in zip(squares, sigmas, strict=True))
    per_m = max(0.0, products / spread) if spread > 0 else 0.0
    return max(MIN_NOISE_M, sigma - per_m * square), per_m


def project_centres(gaussian_map: GaussianMap, frame: RgbdFrame) -> tuple[Indices, Indices, Floats]:
    """Project the centres of Gaussians into a frame.

    Args:
        gaussian_map: Map of the frame.
        frame: With its pose in the map.

    Returns:
        [V] rows of the Gaussians in view, [V] their pixels in the flat image, and [V] depths, m.
    """
    camera = frame.camera
    camera_from_world = np.linalg.inv(camera.world_from_camera)
    offset = camera_from_world[:3, :3] @ gaussian_map.origin + camera_from_world[:3, 3]
    x, y, z = (gaussian_map.means @ camera_from_world[:3, :3].T + offset).T
    ahead = np.maximum(z, 1e-9)
    u, v = camera.fx * x / ahead + camera.cx, camera.fy * y / ahead + camera.cy
    inside = (z > 0) & (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
    rows = np.flatnonzero(inside)
    pixels = v[rows].astype(np.intp) * camera.width + u[rows].astype(np.intp)
    return rows, pixels, z[rows].astype(np.float64)
