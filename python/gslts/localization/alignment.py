"""What a look at a rendering says about the camera: direct image alignment."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gslts._core import align as _core
from gslts.core.camera import Camera, at_pose
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import FloatArray, GaussianMap
from gslts.core.se3 import relative, se3_retract, twist_of
from gslts.rendering.losses import Exposure, fit_exposure
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.types import Floats

PIXELS_PER_FACT = 50.0
"""Neighbouring pixels err together: so many count as one independent measurement."""
DEPTH_SHARE = 0.03
"""Of the say of depth in a pose: its errors are the same in neighbouring pixels and frames, and
colours, which people look at, must fit first."""
PIVOT = 1e-13
"""Share of its diagonal element below which a pivot is rounding."""


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """H x = b for x = (rho, phi, log fx, log fy, cx, cy).

    (rho, phi) is a twist of the pose, world_from_camera @ exp(rho, phi), m before rad in the camera
    frame; the others are changes of the intrinsics, the last two in px.

    Attributes:
        hessian: [10,10].
        right: (10,).
    """

    hessian: Floats
    right: Floats

    def __add__(self, other: NormalEquations) -> NormalEquations:
        return NormalEquations(self.hessian + other.hessian, self.right + other.right)


@dataclass(frozen=True, eq=False)
class Alignment:
    """What colours and depth each say.

    Colours tell about the camera that was rendered. Depth may come from a lens of its own: it tells
    about the twist of that lens, whose intrinsics are trusted, so that their columns are 0.
    """

    color: NormalEquations
    depth: NormalEquations

    def at_full_size(self, divisor: int) -> Alignment:
        """Of an image whose sides were divided by a number: with the centre in px of the whole."""
        scale = np.ones(10)
        scale[8:] = 1 / divisor

        def scaled(equations: NormalEquations) -> NormalEquations:
            hessian = equations.hessian * scale[:, None] * scale
            return NormalEquations(hessian, equations.right * scale)

        return Alignment(scaled(self.color), scaled(self.depth))


def align(
    camera: Camera,
    rgb: FloatArray,
    depth: FloatArray,
    photo: FloatArray,
    measured: FloatArray,
    *,
    mask: NDArray[np.bool_] | None = None,
    exposure: Exposure | None = None,
    threads: int = 0,
) -> Alignment:
    """One Gauss-Newton step of direct image alignment, over means of 2 x 2 pixels.

    Differences of brightness and of depth are weighted as by a Huber loss (0.02, and 1 % of the
    depth) and left out where they are gross (0.25, and 5 %) or at edges of the depth. Results are
    bit-identical for any number of threads.

    Args:
        camera: That was rendered.
        rgb: [H,W,3] rendered, float32 or float64 as all others.
        depth: [H,W] rendered, z, m.
        photo: [H,W,3] as the sensor saw it.
        measured: [H,W] depth, m; 0 where there is none.
        mask: [H,W] bool, pixels wanted; None means all.
        exposure: Applied to `rgb` first; None means none.
        threads: 0 means one a hardware thread.

    Returns:
        Of the changes that make rendering and photograph agree better.

    Raises:
        ValueError: An array has the wrong shape or dtype.

    Source: Kerl et al. 2013, Dense Visual SLAM for RGB-D Cameras.
    """
    function = _core.align_float if rgb.dtype == np.float32 else _core.align_double
    hessian, right, depth_hessian, depth_right = function(
        camera,
        rgb,
        depth,
        photo,
        measured,
        mask=mask,
        exposure=Exposure() if exposure is None else exposure,
        threads=threads,
    )
    return Alignment(NormalEquations(hessian, right), NormalEquations(depth_hessian, depth_right))


def solve_positive(matrix: Floats, right: Floats) -> Floats:
    """Solves small normal equations by Gaussian elimination, in one order of sums.

    `np.linalg.solve` (OpenBLAS) rounds differently from processor to processor. Unknowns that the
    equations do not fix, where a pivot is nothing but rounding, stay 0.

    Args:
        matrix: [N,N] symmetric and positive semidefinite, so that no row is exchanged.
        right: [N] or [N,M].

    Returns:
        x of matrix @ x = right, in the shape of `right`, float64.
    """
    left, x = np.array(matrix, np.float64), np.array(right, np.float64)
    least = PIVOT * np.diag(matrix)
    fixed = [k for k in range(len(left)) if _eliminate(left, x, k, least[k])]
    result = np.zeros_like(x)
    for k in reversed(fixed):
        for later in fixed:
            if later > k:
                x[k] -= left[k, later] * result[later]
        result[k] = x[k] / left[k, k]
    return result


def _eliminate(left: Floats, right: Floats, k: int, least: float) -> bool:
    """Takes unknown k out of the rows below its own; returns whether its pivot is above `least`."""
    if not left[k, k] > least:
        return False
    factors = left[k + 1 :, k] / left[k, k]
    left[k + 1 :] -= np.multiply.outer(factors, left[k])
    right[k + 1 :] -= np.multiply.outer(factors, right[k])
    return True


def aligned(
    gaussian_map: GaussianMap,
    frames: Iterable[RgbdFrame],
    steps: int,
    *,
    stds: tuple[float, float] | None = None,
    threads: int = 0,
) -> Floats:
    """[4,4] world_from_camera nearby, where a map fits best what a camera saw.

    Args:
        gaussian_map: float32.
        frames: One frame in several resolutions, the coarsest first, all at one pose.
        steps: With each.
        stds: How far the given pose is expected to be off, m and rad; None means anything.
        threads: 0 means one a hardware thread.

    Raises:
        ValueError: There is no frame.
    """
    rasterizer, options = Rasterizer(np.float32), RenderOptions(threads=threads)
    pose: Floats | None = None
    given = np.eye(4)
    # A millionth, so that a frame that sees nothing stays where it is.
    prior = np.full(6, 1e-6) if stds is None else PIXELS_PER_FACT / np.repeat(stds, 3) ** 2
    for frame in frames:
        camera = frame.camera if pose is None else at_pose(frame.camera, pose)
        given = frame.camera.world_from_camera
        photo, measured = frame.rgb.astype(np.float32) / np.float32(255), np.nan_to_num(frame.depth)
        for _ in range(steps):
            images = rasterizer.forward(gaussian_map, camera, options)
            exposure = fit_exposure(images.rgb, photo, mask=frame.mask, threads=threads)
            alignment = align(
                camera,
                images.rgb,
                images.depth,
                photo,
                measured,
                mask=frame.mask,
                exposure=exposure,
                threads=threads,
            )
            color, depth = alignment.color, alignment.depth
            hessian = color.hessian[:6, :6] + DEPTH_SHARE * depth.hessian[:6, :6] + np.diag(prior)
            off = twist_of(relative(given, camera.world_from_camera))
            right = color.right[:6] + DEPTH_SHARE * depth.right[:6] - prior * off
            twist = solve_positive(hessian, right)
            camera = at_pose(camera, se3_retract(camera.world_from_camera, twist))
        pose = camera.world_from_camera
    if pose is None:
        raise ValueError("aligned: there is no frame")
    return pose
