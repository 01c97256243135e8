"""Small scenes and comparisons that several tests share."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

import gslts
from gslts.mapping.order import sort_by_place
from gslts.rendering.rasterizer import Images


def random_map(
    size: int,
    *,
    seed: int = 0,
    sh_degree: int = 0,
    feature_dims: int = 0,
    dtype: DTypeLike = np.float64,
    origin: tuple[float, float, float] = (0, 0, 0),
) -> gslts.GaussianMap:
    """Gaussians of all shapes in a ball of 1 m around the map's origin.

    The numbers are drawn in float32, so that both precisions hold the same map.
    """
    rng = np.random.default_rng(seed)
    arrays = {
        "means": rng.normal(0, 0.4, (size, 3)),
        "quats": rng.normal(size=(size, 4)),
        "log_scales": rng.normal(-2.5, 0.8, (size, 3)),
        "logit_opacities": rng.normal(0.5, 2, size),
        "sh": rng.normal(0, 0.5, (size, (sh_degree + 1) ** 2, 3)),
        "features": rng.normal(size=(size, feature_dims)),
    }
    arrays = {name: array.astype(np.float32).astype(dtype) for name, array in arrays.items()}
    return gslts.GaussianMap(**arrays, origin=np.array(origin, np.float64))


def orbit_camera(
    width: int = 53,
    height: int = 38,
    *,
    angle_rad: float = 0.3,
    distance_m: float = 2.5,
    fov_rad: float = 0.9,
    target: tuple[float, float, float] = (0, 0, 0),
) -> gslts.Camera:
    """Camera on a circle around `target`, looking at it."""
    offset = distance_m * np.array([np.cos(angle_rad), np.sin(angle_rad), 0.4])
    pose = gslts.look_at(np.array(target) + offset, target)
    return gslts.camera_from_fov(width, height, fov_rad, pose)


def single_gaussian(dtype: DTypeLike = np.float64, **changes: Any) -> gslts.GaussianMap:
    """A grey ball of 10 cm at the origin, opacity 0.5; arguments replace its arrays."""
    arrays: dict[str, Any] = {
        "means": np.zeros((1, 3)),
        "quats": np.array([[1.0, 0, 0, 0]]),
        "log_scales": np.full((1, 3), np.log(0.1)),
        "logit_opacities": np.zeros(1),
        "sh": np.zeros((1, 1, 3)),
    }
    arrays |= changes
    return gslts.GaussianMap(**{name: np.asarray(a, dtype) for name, a in arrays.items()})


def image_bytes(images: Images) -> tuple[bytes, ...]:
    arrays = (images.rgb, images.depth, images.alpha, images.features)
    return tuple(array.tobytes() for array in arrays)


def random_image_gradients(images: Images, seed: int = 0) -> dict[str, NDArray[Any]]:
    """Arguments for `Rasterizer.backward`: a loss that depends on every image."""
    rng = np.random.default_rng(seed)
    return {
        "dL_drgb": rng.normal(size=images.rgb.shape).astype(images.rgb.dtype),
        "dL_ddepth": rng.normal(size=images.depth.shape).astype(images.rgb.dtype),
        "dL_dalpha": rng.normal(size=images.alpha.shape).astype(images.rgb.dtype),
        "dL_dfeatures": rng.normal(size=images.features.shape).astype(images.rgb.dtype),
    }


def render_bytes(threads: int) -> tuple[bytes, ...]:
    """Render a scene; child processes call this function, so it must be importable by name."""
    options = gslts.RenderOptions(threads=threads)
    return image_bytes(gslts.render(random_map(300, dtype=np.float32), orbit_camera(), options))


def in_clusters(gaussian_map: gslts.GaussianMap) -> gslts.GaussianMap:
    """Return the Gaussians small and in eight clusters, most of them out of view of a camera."""
    rng = np.random.default_rng(1)
    centres = 15 * rng.normal(size=(8, 3)).astype(np.float32)
    means = gaussian_map.means + centres[rng.integers(8, size=gaussian_map.size)]
    log_scales = gaussian_map.log_scales - np.float32(5)
    origin = np.zeros(3)
    return sort_by_place(replace(gaussian_map, means=means, log_scales=log_scales, origin=origin))
