"""Direct image alignment: corrects a camera pose by comparing a frame with renderings of a map.

Kerl, Sturm and Cremers 2013, Dense Visual SLAM for RGB-D Cameras.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from gslts._core import align as _core
from gslts.core.camera import Camera, at_pose
from gslts.core.frame import RgbdFrame
from gslts.core.gaussian_map import FloatArray, GaussianMap
from gslts.core.se3 import relative, se3_retract, twist_of
from gslts.localization.constants import (
    CORRELATED_PIXELS,
    DEPTH_WEIGHT,
    MAX_ALIGN_STEPS,
    MAX_EXTRAPOLATION,
    MIN_PIVOT,
    MIN_STEP_PX,
)
from gslts.rendering.losses import Exposure, fit_exposure
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.rendering.view_range import view_range_m
from gslts.types import Bools, Floats


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """Gauss-Newton normal equations H x = b for x = (rho, phi, log fx, log fy, cx, cy).

    (rho, phi) is a twist of world_from_camera @ exp(rho, phi), m and rad, in the camera frame; the
    others are changes of the intrinsics, cx and cy in px.

    Attributes:
        hessian: [10,10] H.
        right: (10,) b.
    """

    hessian: Floats
    right: Floats

    def __add__(self, other: NormalEquations) -> NormalEquations:
        return NormalEquations(self.hessian + other.hessian, self.right + other.right)

    def rescale(self, scale: Floats) -> NormalEquations:
        """Return the equations for the unknowns x / scale.

        Args:
            scale: (10,).
        """
        return NormalEquations(self.hessian * scale[:, None] * scale, self.right * scale)


@dataclass(frozen=True, eq=False)
class Alignment:
    """Normal equations of the colour and of the depth residuals of one frame.

    Colour constrains the rendered camera. Depth may come from a camera of its own: it constrains
    the twist of that camera, whose intrinsics are taken as exact, so that their columns are 0.

    Attributes:
        color: Normal equations of the colours.
        depth: Normal equations of the depth.
    """

    color: NormalEquations
    depth: NormalEquations

    def at_full_size(self, divisor: int) -> Alignment:
        """Convert the equations of a reduced image, so that cx and cy are px of the full image.

        Args:
            divisor: Number by which the sides of the image were divided.
        """
        scale = np.ones(10)
        scale[8:] = 1 / divisor
        return Alignment(self.color.rescale(scale), self.depth.rescale(scale))


def align(
    camera: Camera,
    rendered_rgb: FloatArray,
    rendered_depth: FloatArray,
    observed_rgb: FloatArray,
    observed_depth: FloatArray,
    *,
    mask: Bools | None = None,
    exposure: Exposure | None = None,
    threads: int = 0,
) -> Alignment:
    """Set up one Gauss-Newton step of direct image alignment, over means of 2 x 2 pixels.

    Residuals of brightness and depth have Huber weights (0.02, and 1 % of the depth); outliers
    (0.25, and 5 %) and edges of the depth are left out. Results are bit-identical for any number
    of threads.

    Args:
        camera: Camera of the rendering.
        rendered_rgb: [H,W,3] colours, float32 or float64, as all other images.
        rendered_depth: [H,W] z, m.
        observed_rgb: [H,W,3] colours of the frame.
        observed_depth: [H,W] z, m; 0 where there is none.
        mask: [H,W] pixels that count; None means all.
        exposure: Exposure applied to `rendered_rgb` first; None means none.
        threads: Number of threads; 0 means one per hardware thread.

    Returns:
        Normal equations of the step that makes rendering and frame agree better.

    Raises:
        ValueError: An array has the wrong shape or dtype.

    Source: Kerl et al. 2013, Dense Visual SLAM for RGB-D Cameras.
    """
    function = _core.align_float if rendered_rgb.dtype == np.float32 else _core.align_double
    hessian, right, depth_hessian, depth_right = function(
        camera,
        rendered_rgb,
        rendered_depth,
        observed_rgb,
        observed_depth,
        mask=mask,
        exposure=Exposure() if exposure is None else exposure,
        threads=threads,
    )
    return Alignment(NormalEquations(hessian, right), NormalEquations(depth_hessian, depth_right))


def solve_positive(matrix: Floats, right: Floats) -> Floats:
    """Solve small normal equations by Gaussian elimination, with sums in one fixed order.

    `np.linalg.solve` (OpenBLAS) rounds differently from processor to processor. Unknowns that the
    equations do not determine, whose pivot is only rounding error, stay 0.

    Args:
        matrix: [N,N] symmetric and positive semidefinite, so that no row is exchanged.
        right: [N] or [N,M].

    Returns:
        x of matrix @ x = right, in the shape of `right`, float64.
    """
    left, x = np.array(matrix, np.float64), np.array(right, np.float64)
    min_pivots = MIN_PIVOT * np.diag(matrix)
    determined = [k for k in range(len(left)) if _eliminate(left, x, k, min_pivots[k])]
    result = np.zeros_like(x)
    for k in reversed(determined):
        for later in determined:
            if later > k:
                x[k] -= left[k, later] * result[later]
        result[k] = x[k] / left[k, k]
    return result


def _eliminate(left: Floats, right: Floats, k: int, min_pivot: float) -> bool:
    """Eliminate unknown k from the rows below its own, in place; False if the pivot is small."""
    if not left[k, k] > min_pivot:
        return False
    factors = left[k + 1 :, k] / left[k, k]
    left[k + 1 :] -= np.multiply.outer(factors, left[k])
    right[k + 1 :] -= np.multiply.outer(factors, right[k])
    return True


def align_pose(
    gaussian_map: GaussianMap,
    frames: Iterable[RgbdFrame],
    *,
    stds: tuple[float, float] | None = None,
    threads: int = 0,
) -> Floats:
    """Correct the pose of a frame so that the map fits its images best.

    Gauss-Newton steps at each resolution end when one moves the image by less than `MIN_STEP_PX`,
    or after `MAX_ALIGN_STEPS`. Results are bit-identical for any number of threads.

    Args:
        gaussian_map: float32.
        frames: One frame at several resolutions, the coarsest first, all at one pose.
        stds: Standard deviations of the given pose, m and rad, as a prior; None means no prior.
        threads: Number of threads; 0 means one per hardware thread.

    Returns:
        [4,4] world_from_camera, m.

    Raises:
        ValueError: There is no frame.
    """
    rasterizer = Rasterizer(np.float32)
    pose: Floats | None = None
    # Without a prior, a millionth keeps a frame that sees nothing where it is.
    prior = np.full(6, 1e-6) if stds is None else CORRELATED_PIXELS / np.repeat(stds, 3) ** 2
    for frame in frames:
        camera = frame.camera if pose is None else at_pose(frame.camera, pose)
        observed_rgb = frame.rgb.astype(np.float32) / np.float32(255)
        observed_depth = np.nan_to_num(frame.depth)
        options = RenderOptions(far_m=view_range_m(observed_depth), threads=threads)
        last: _Step | None = None
        for _ in range(MAX_ALIGN_STEPS):
            images = rasterizer.forward(gaussian_map, camera, options)
            exposure = fit_exposure(images.rgb, observed_rgb, mask=frame.mask, threads=threads)
            alignment = align(
                camera,
                images.rgb,
                images.depth,
                observed_rgb,
                observed_depth,
                mask=frame.mask,
                exposure=exposure,
                threads=threads,
            )
            twist = _solve_step(alignment, camera, frame.camera.world_from_camera, prior)
            step = _Step.of(twist, camera, images.depth)
            camera = at_pose(camera, step.end if last is None else step.extrapolate(last))
            if step.motion_px < MIN_STEP_PX:
                break
            last = step
        pose = camera.world_from_camera
    if pose is None:
        raise ValueError("align_pose: frames: expected at least one frame, got none")
    return pose


def _solve_step(alignment: Alignment, camera: Camera, given: Floats, prior: Floats) -> Floats:
    """Solve for the twist (6,) of the camera, with weights (6,) of the given pose as a prior."""
    color, depth = alignment.color, alignment.depth
    hessian = color.hessian[:6, :6] + DEPTH_WEIGHT * depth.hessian[:6, :6] + np.diag(prior)
    error = twist_of(relative(given, camera.world_from_camera))
    right = color.right[:6] + DEPTH_WEIGHT * depth.right[:6] - prior * error
    return solve_positive(hessian, right)


@dataclass(frozen=True, eq=False)
class _Step:
    """Gauss-Newton step of a pose.

    Attributes:
        angles_rad: (6,) angles by which translation and rotation move the middle of the image.
        motion_px: Maximum motion of the middle of the image, px.
        end: [4,4] world_from_camera after the step, m.
    """

    angles_rad: Floats
    motion_px: float
    end: Floats

    @classmethod
    def of(cls, twist: Floats, camera: Camera, depth: FloatArray) -> _Step:
        """Make the step of a camera by a twist (6,); distances are the median of the depth."""
        distance_m = float(np.median(depth[depth > 0])) if (depth > 0).any() else np.inf
        angles_rad = twist / np.repeat([distance_m, 1], 3)
        # Not `@`, which rounds differently from processor to processor.
        angle_rad = np.sqrt((angles_rad.reshape(2, 3) ** 2).sum(axis=1)).sum()
        motion_px = float(max(camera.fx, camera.fy) * angle_rad)
        return cls(angles_rad, motion_px, se3_retract(camera.world_from_camera, twist))

    def extrapolate(self, last: _Step) -> Floats:
        """Return the pose [4,4] to which this step and the one before it converge.

        Steps fall short, as the weights of errors change with them, and shrink by about a half.

        Source: Anderson acceleration with one earlier step; Pavlov et al. 2018, AA-ICP.
        """
        change = self.angles_rad - last.angles_rad
        share = -float((self.angles_rad * change).sum()) / max(float((change**2).sum()), 1e-30)
        twist = twist_of(relative(last.end, self.end))
        return se3_retract(self.end, min(max(share, 0.0), MAX_EXTRAPOLATION) * twist)
