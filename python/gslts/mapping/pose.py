"""Correction of a camera's pose by one look at what was rendered there.

Source: direct image alignment by Gauss-Newton, Kerl et al. 2013, Dense Visual SLAM for RGB-D
Cameras.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gslts.camera import Camera, at_pose, rotation, rotation_vector
from gslts.gaussian_map import FloatArray

Floats = NDArray[np.float64]

GREY_STD, GREY_OUTLIER = 0.02, 0.25
"""Below the first, all differences of brightness count alike; above the second, none does."""
DEPTH_STD_SHARE, DEPTH_OUTLIER_SHARE = 0.01, 0.05
"""The same for differences of the depth, as shares of it."""


@dataclass(frozen=True, eq=False)
class NormalEquations:
    """H xi = b for a twist xi = (rho, phi), m before rad, camera frame."""

    hessian: Floats
    right: Floats

    def __add__(self, other: NormalEquations) -> NormalEquations:
        return NormalEquations(self.hessian + other.hessian, self.right + other.right)


def align(
    camera: Camera, rgb: FloatArray, depth: FloatArray, photo: FloatArray, measured: FloatArray
) -> NormalEquations:
    """What a rendering and a photograph say about the error of the pose.

    Args:
        camera: That was rendered from.
        rgb: [H,W,3] rendered, with the exposure of the photograph.
        depth: [H,W] rendered, m.
        photo: [H,W,3].
        measured: [H,W] depth, m; 0 where there is none.

    Returns:
        Of the twist such that world_from_camera @ exp(xi) fits better.
    """
    grey, wanted = (_binned(image.mean(axis=2)) for image in (rgb, photo))
    z, z_measured = _binned(depth), _binned(measured)
    complete = (_binned((measured > 0).astype(np.float32)) == 1) & (z > 0)
    rows, columns = np.indices(grey.shape)
    x = (2 * columns + 1 - camera.cx) / camera.fx * z
    y = (2 * rows + 1 - camera.cy) / camera.fy * z
    points = np.stack([x, y, z], axis=-1)
    safe = np.maximum(z, 1e-3)
    fx, fy = camera.fx / 2 / safe, camera.fy / 2 / safe

    def towards_point(image: NDArray[np.floating]) -> Floats:
        """Change of an image's value at its pixel for a shift of the point there."""
        down, right = np.gradient(image)
        along_z = -(right * fx * x + down * fy * y) / safe
        return np.stack([right * fx, down * fy, along_z], axis=-1)

    inside = np.zeros(z.shape, bool)
    inside[1:-1, 1:-1] = z[1:-1, 1:-1] > 0
    residual = wanted - grey
    weight = (np.abs(residual) < GREY_OUTLIER) / np.maximum(np.abs(residual), GREY_STD)
    equations = _equations(points, towards_point(grey), residual, weight * inside / GREY_STD)
    # A point that comes nearer also changes the depth itself.
    slope = towards_point(z) - np.array([0.0, 0.0, 1.0])
    residual = z_measured - z
    share = np.abs(residual) / safe
    weight = (share < DEPTH_OUTLIER_SHARE) / np.maximum(share, DEPTH_STD_SHARE)
    weight = weight * (inside & complete) / (DEPTH_STD_SHARE * safe**2)
    return equations + _equations(points, slope, residual, weight)


def moved(camera: Camera, twist: Floats) -> Camera:
    """The camera at world_from_camera @ exp(xi), with exp to first order in the translation."""
    step = np.eye(4)
    step[:3, :3], step[:3, 3] = rotation(twist[3:]), twist[:3]
    return at_pose(camera, camera.world_from_camera @ step)


def twist_between(start: Camera, end: Camera) -> Floats:
    """The twist (6,) with which `moved` takes the start to the end, for turns well below pi."""
    motion = np.linalg.inv(start.world_from_camera) @ end.world_from_camera
    return np.concatenate([motion[:3, 3], rotation_vector(motion[:3, :3])])


def _equations(points: Floats, slope: Floats, residual: Floats, weight: Floats) -> NormalEquations:
    """Of residual = slope . (rho + phi x point), weighted, over all pixels that count."""
    used = weight > 0
    slope, point = slope[used], points[used]
    rows = np.concatenate([slope, np.cross(point, slope)], axis=1)
    weighted = rows * weight[used, None]
    return NormalEquations(weighted.T @ rows, weighted.T @ residual[used])


def _binned(image: FloatArray | NDArray[np.floating]) -> Floats:
    """Means of 2 x 2 pixels."""
    height, width = (length // 2 * 2 for length in image.shape)
    part = image[:height, :width].astype(np.float64)
    return 0.25 * (part[::2, ::2] + part[1::2, ::2] + part[::2, 1::2] + part[1::2, 1::2])
