"""Time and accuracy of each setting of the renderer, on a map and a camera.

The exact image is rendered in float64 without any cut-off: no alpha is too small and no pixel ends
before its last Gaussian. Each setting changes one option of the default.
"""

from __future__ import annotations

import csv
import math
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gslts.core.camera import Camera, downscale
from gslts.core.gaussian_map import FloatArray, GaussianMap
from gslts.rendering.metrics import psnr_from_mse_db
from gslts.rendering.rasterizer import Gradients, Rasterizer, RenderOptions
from gslts.types import Floats

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


TIME_RESOLUTION = 0.03
"""Relative difference of times that a machine with other work does not resolve."""
PSNR_RESOLUTION_DB = 0.1
"""Difference of PSNR below which two settings count as equally accurate."""


@dataclass(frozen=True)
class Setting:
    """Settings of the renderer: the default but for one option.

    Attributes:
        knob: Name of the option.
        value: Its value, as text.
        options: Arguments of `RenderOptions`.
        dtype: float32 or float64.
        shrink: Both sides of the image are rendered at 1 / shrink of their size and interpolated.
    """

    knob: str
    value: str
    options: dict[str, Any] = field(default_factory=dict)
    dtype: type = np.float32
    shrink: int = 1


EXACT = Setting("exact", "", {"alpha_min": 1e-30, "transmittance_min": 0.0}, np.float64)
"""Reference without cut-offs."""
SETTINGS = (
    Setting("default", ""),
    *(
        Setting("alpha cut-off", f"1/{n}", {"alpha_min": 1 / n})
        for n in (32, 64, 128, 255, 1024, 4096, 100_000)
    ),
    *(
        Setting("transmittance stop", f"{t:g}", {"transmittance_min": t})
        for t in (1e-1, 1e-2, 1e-3, 1e-5, 0.0)
    ),
    *(Setting("SH degree", str(degree), {"sh_degree": degree}) for degree in (0, 1, 2)),
    *(Setting("resolution", f"1/{n}", shrink=n) for n in (2, 4)),
    Setting("exp degree", "5", {"exp_degree": 5}),
    Setting("precision", "float64", dtype=np.float64),
    Setting(
        "no cut-off",
        "float32",
        {"alpha_min": 1e-30, "transmittance_min": 0.0, "exp_degree": 5},
    ),
)
"""Settings that are compared; each but the default changes one option."""


@dataclass(frozen=True)
class Point:
    """Time and error of one setting.

    Attributes:
        knob, value: See `Setting`.
        forward_ms: Median time of an image.
        forward_backward_ms: Median time of an image and its gradients.
        psnr_db: PSNR of the colours against the exact image, for a peak of 1.
        max_error: Maximum error of a colour.
        gradient_error: |g - exact| / |exact| of the gradient of the mean squared colour; the
            maximum over means, quaternions, log scales, logit opacities and SH.
        on_front: Whether no other setting is better in time or accuracy without being worse in the
            other.
    """

    knob: str
    value: str
    forward_ms: float
    forward_backward_ms: float
    psnr_db: float
    max_error: float
    gradient_error: float
    on_front: bool


@dataclass(frozen=True)
class _View:
    """A map in both precisions and a camera, shared by all settings."""

    maps: dict[Any, GaussianMap]  # by dtype
    rasterizers: dict[Any, Rasterizer]
    camera: Camera
    near_m: float
    threads: int


class _Job:
    """Renders a view with one setting."""

    def __init__(self, view: _View, setting: Setting) -> None:
        self.map, self.rasterizer = view.maps[setting.dtype], view.rasterizers[setting.dtype]
        self.options = RenderOptions(near_m=view.near_m, threads=view.threads, **setting.options)
        self.camera = downscale(view.camera, setting.shrink)
        self.rows = _interpolation(view.camera.height, self.camera.height)
        self.columns = _interpolation(view.camera.width, self.camera.width)

    def forward(self) -> FloatArray:
        """Render the colours with the pixels of the setting."""
        return self.rasterizer.forward(self.map, self.camera, self.options).rgb

    def backward(self, dL_drgb: FloatArray) -> Gradients:
        """Return the gradients of the last forward."""
        return self.rasterizer.backward(dL_drgb=dL_drgb)

    def enlarge(self, rgb: FloatArray) -> FloatArray:
        """Interpolate colours to the size of the view."""
        if len(self.rows) == len(rgb):
            return rgb
        enlarged: Floats = np.einsum("yr,rcd,xc->yxd", self.rows, rgb, self.columns, optimize=True)
        return enlarged

    def shrink(self, dL_drgb: Floats) -> FloatArray:
        """Return the gradient with respect to the colours before interpolation."""
        if self.camera.height < len(dL_drgb):
            dL_drgb = np.einsum("yr,yxd,xc->rcd", self.rows, dL_drgb, self.columns, optimize=True)
        return dL_drgb.astype(self.map.dtype)


def measure(
    gaussian_map: GaussianMap,
    camera: Camera,
    *,
    near_m: float = RenderOptions().near_m,
    threads: int = 1,
    rounds: int = 15,
    settings: Sequence[Setting] = SETTINGS,
    progress: Callable[[Iterable[int]], Iterable[int]] = iter,
) -> list[Point]:
    """Render and differentiate with every setting, and compare with the exact rendering.

    All settings are measured in each round, in an order of its own, so that other work on the
    machine affects all alike: a time is the median, over the rounds, of its ratio to the geometric
    mean of the round, times the median of those means.

    Args:
        gaussian_map: Map to render.
        camera: Camera of the view.
        near_m: Near plane, m.
        threads: 0 means one per hardware thread.
        rounds: Number of times that every setting is measured.
        settings: Settings to compare.
        progress: Wraps the rounds to show progress.

    Returns:
        A point for each setting.

    Raises:
        ValueError: The map is empty or shows nothing to the camera, the image is too small to be
            shrunk, or rounds is below 1.
    """
    if rounds < 1:
        raise ValueError(f"measure: rounds must be at least 1, got {rounds}")
    least = max(setting.shrink for setting in settings)
    if min(camera.width, camera.height) < least:
        raise ValueError(f"measure: the image must be at least {least} px wide and high")
    maps = {dtype: gaussian_map.astype(dtype) for dtype in (np.float32, np.float64)}
    view = _View(maps, {dtype: Rasterizer(dtype) for dtype in maps}, camera, near_m, threads)
    job = _Job(view, EXACT)
    exact = job.forward()
    if not exact.any():
        raise ValueError("measure: the camera sees nothing of the map")
    dL_drgb = 2 * exact / exact.size
    exact_gradients = job.backward(dL_drgb)

    times = np.empty((rounds, len(settings), 2))
    errors: dict[int, tuple[float, float, float]] = {}
    rng = np.random.default_rng(0)
    for round_ in progress(range(rounds)):
        for i in rng.permutation(len(settings)):
            job = _Job(view, settings[i])
            by_rgb = job.shrink(dL_drgb)
            # Not timed: the setting before had other needs of memory.
            rgb, gradients = job.forward(), job.backward(by_rgb)
            if round_ == 0:
                errors[i] = _errors(
                    job.enlarge(rgb), exact, gradients, exact_gradients, gaussian_map.size
                )
            start = time.perf_counter()
            job.forward()
            middle = time.perf_counter()
            job.backward(by_rgb)
            times[round_, i] = middle - start, time.perf_counter() - start
    means = np.exp(np.log(times).mean(axis=1, keepdims=True))
    ms = 1e3 * np.median(times / means, axis=0) * np.median(means, axis=0)
    front = pareto_front(ms[:, 0], np.array([errors[i][0] for i in range(len(settings))]))
    return [
        Point(
            setting.knob,
            setting.value,
            float(ms[i, 0]),
            float(ms[i, 1]),
            *errors[i],
            bool(front[i]),
        )
        for i, setting in enumerate(settings)
    ]


def pareto_front(ms: Floats, psnr: Floats) -> NDArray[np.bool_]:
    """Find points such that no other point is better in one criterion and no worse in the other.

    Args:
        ms: [N] times.
        psnr: [N] accuracies, dB. Differences below the resolutions above do not count.

    Returns:
        [N] bool.
    """
    faster = ms[:, None] < (1 - TIME_RESOLUTION) * ms
    as_fast = ms[:, None] <= ms
    finer = psnr[:, None] > psnr + PSNR_RESOLUTION_DB
    as_fine = psnr[:, None] > psnr - PSNR_RESOLUTION_DB
    dominates = (faster & as_fine) | (finer & as_fast)
    return np.asarray(~dominates.any(axis=0))


def write_csv(points: Sequence[DataclassInstance], path: Path) -> None:
    """Write points as CSV with the names of their fields on top.

    Args:
        points: At least one.
        path: File to write.
    """
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, [column.name for column in fields(points[0])])
        writer.writeheader()
        for point in points:
            writer.writerow(asdict(point))


def _interpolation(fine: int, coarse: int) -> Floats:
    """Return a matrix [fine,coarse] of linear interpolation between pixel centres."""
    at = np.clip((np.arange(fine) + 0.5) * coarse / fine - 0.5, 0, coarse - 1)
    left = np.minimum(at.astype(int), max(coarse - 2, 0))
    weights = np.zeros((fine, coarse))
    weights[np.arange(fine), left] = 1 - (at - left)
    weights[np.arange(fine), np.minimum(left + 1, coarse - 1)] += at - left
    return weights


def _errors(
    rgb: FloatArray,
    exact: FloatArray,
    gradients: Gradients,
    exact_gradients: Gradients,
    size: int,
) -> tuple[float, float, float]:
    """Return PSNR, maximum error of a colour and maximum relative error of a group's gradient."""
    found, wanted = gradients.dense(size), exact_gradients.dense(size)
    of_gradients = []
    for name in ("dL_dmeans", "dL_dquats", "dL_dlog_scales", "dL_dlogit_opacities", "dL_dsh"):
        norm = float(np.linalg.norm(getattr(wanted, name)))
        difference = float(np.linalg.norm(getattr(found, name) - getattr(wanted, name)))
        if norm > 0:
            of_gradients.append(difference / norm)
    mse = float(np.mean((rgb.astype(np.float64) - exact) ** 2))
    return (
        psnr_from_mse_db(mse, math.inf),
        float(np.abs(rgb - exact).max()),
        max(of_gradients, default=0.0),
    )
