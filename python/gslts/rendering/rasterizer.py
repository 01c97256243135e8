"""Rasterizer of Gaussian maps and its gradients (3D Gaussian splatting, Kerbl et al. 2023)."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields, replace
from math import prod
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from gslts._core.map import scatter_rows_double, scatter_rows_float, scatter_rows_uint32
from gslts._core.raster import RasterizerDouble, RasterizerFloat, RenderOptions, chunks_in_view
from gslts.core.camera import Camera
from gslts.core.gaussian_map import FloatArray, GaussianMap
from gslts.types import Bools, Floats, Indices, UInts32

__all__ = [
    "Gradients",
    "Images",
    "LiftedFeatures",
    "Rasterizer",
    "RenderOptions",
    "render",
    "rows_in_view",
]

_RASTERIZERS: dict[np.dtype[Any], type[RasterizerFloat] | type[RasterizerDouble]] = {
    np.dtype(np.float32): RasterizerFloat,
    np.dtype(np.float64): RasterizerDouble,
}
"""Rasterizer of the core by dtype of the map."""
_SCATTER_ROWS: dict[np.dtype[Any], Callable[..., NDArray[Any]]] = {
    np.dtype(np.float32): scatter_rows_float,
    np.dtype(np.float64): scatter_rows_double,
    np.dtype(np.uint32): scatter_rows_uint32,
}
"""Function of the core by dtype of the values."""


@dataclass(frozen=True, eq=False)
class Images:
    """Rendered images in the dtype of the map; w_i = alpha_i prod_{j<i} (1 - alpha_j) at a pixel.

    Attributes:
        rgb: [H,W,3] sum w_i c_i + (1 - alpha) background; linear in the map's colours, not clipped.
        depth: [H,W] expected depth, sum w_i z_i / sum w_i, z in the camera frame, m;
            0 where nothing was blended.
        alpha: [H,W] sum w_i.
        features: [H,W,D] sum w_i f_i.
    """

    rgb: FloatArray
    depth: FloatArray
    alpha: FloatArray
    features: FloatArray


@dataclass(frozen=True, eq=False)
class Gradients:
    """Gradients of a loss L with respect to the stored parameters of the V Gaussians in view.

    All other Gaussians of the map have gradient zero.

    Attributes:
        rows: [V] rows of the map, ascending.
        dL_dmeans: [V,3].
        dL_dquats: [V,4].
        dL_dlog_scales: [V,3].
        dL_dlogit_opacities: [V].
        dL_dsh: [V,K,3].
        dL_dfeatures: [V,D].
        dL_dtwist: (6,) float64, gradient with respect to xi = (rho, phi), translation (m) before
            rotation (rad), both in the camera frame, of world_from_camera @ exp(xi) at xi = 0.
        abs_dL_dmeans2d: [V,2] sum of `|dL/dmean2d|` over the pixels at which the Gaussian was
            blended, per px (AbsGS, Ye et al. 2024). This and the following on request only.
        max_weights: [V] maximum blend weight w.
        pixel_counts: [V] uint32, number of pixels at which the Gaussian was blended.
    """

    rows: UInts32
    dL_dmeans: FloatArray
    dL_dquats: FloatArray
    dL_dlog_scales: FloatArray
    dL_dlogit_opacities: FloatArray
    dL_dsh: FloatArray
    dL_dfeatures: FloatArray
    dL_dtwist: Floats
    abs_dL_dmeans2d: FloatArray | None = None
    max_weights: FloatArray | None = None
    pixel_counts: UInts32 | None = None

    def select(self, wanted: Bools) -> Gradients:
        """Return the gradients of some Gaussians only.

        Args:
            wanted: [N] of all Gaussians of the map.
        """
        kept = wanted[self.rows]
        if kept.all():
            return self
        parts = {}
        for field in fields(self):
            array = getattr(self, field.name)
            if field.name != "dL_dtwist" and array is not None:
                parts[field.name] = array[kept]
        return replace(self, **parts)

    def dense(self, size: int) -> Gradients:
        """Return the gradients with a row for every Gaussian, zero if not in view.

        Args:
            size: Number of Gaussians of the map.

        Raises:
            ValueError: `size` is too small for `rows`.
        """
        arrays = {field.name: getattr(self, field.name) for field in fields(self)}
        per_gaussian = {
            name: scatter_rows(self.rows, array, size)
            for name, array in arrays.items()
            if name not in ("rows", "dL_dtwist") and array is not None
        }
        rows = np.arange(size, dtype=np.uint32)
        return Gradients(rows=rows, dL_dtwist=self.dL_dtwist, **per_gaussian)


@dataclass(frozen=True, eq=False)
class LiftedFeatures:
    """Feature image back-projected to the V Gaussians in view; w_p is a blend weight at pixel p.

    Over several views, sum both: their quotient is the mean feature of a Gaussian.

    Attributes:
        rows: [V] rows of the map, ascending.
        weighted_features: [V,D] sum_p w_p S_p.
        weights: [V] sum_p w_p.
    """

    rows: UInts32
    weighted_features: FloatArray
    weights: FloatArray


class Rasterizer:
    """Renders maps and differentiates the rendering.

    An object holds the memory of one rendering: `backward` differentiates the last `forward`, and
    both reuse the memory of the call before. Each thread needs its own object; the
    GIL is released. Results are bit-identical for any thread count.

    Args:
        dtype: float32, the fast kernel, or float64, the same algorithm without approximations.
    """

    def __init__(self, dtype: DTypeLike = np.float32) -> None:
        self.dtype = np.dtype(dtype)
        if self.dtype not in _RASTERIZERS:
            raise ValueError(f"dtype: expected float32 or float64, got {self.dtype}")
        self._core = _RASTERIZERS[self.dtype]()
        self._view: Any = None  # View of the map of the last forward.

    def forward(
        self,
        gaussian_map: GaussianMap,
        camera: Camera,
        options: RenderOptions | None = None,
        *,
        mask: Bools | None = None,
    ) -> Images:
        """Render a map.

        Args:
            gaussian_map: Map of this rasterizer's dtype; kept for `backward`.
            camera: Camera at world_from_camera.
            options: Options; None means `RenderOptions()`.
            mask: [H,W] pixels to render; None means all. Other pixels are zero in every image and
                have no part in the gradients; the time is proportional to the 4x4 blocks that the
                mask touches.

        Raises:
            OSError: Gaussians in view cannot be read.
            ValueError: The map has another dtype, the mask another shape or dtype, an option is out
                of range, or Gaussians in view are damaged on the disk.
        """
        if gaussian_map.dtype != self.dtype:
            raise ValueError(
                f"Rasterizer.forward: gaussian_map is {gaussian_map.dtype}, "
                f"this rasterizer {self.dtype}"
            )
        view: Any = gaussian_map.view(whole=False)
        images = self._core.forward(
            view,
            camera=camera,
            options=RenderOptions() if options is None else options,
            mask=_contiguous(mask),
        )
        self._view = view
        return Images(**images)

    def backward(
        self,
        *,
        dL_drgb: FloatArray | None = None,
        dL_ddepth: FloatArray | None = None,
        dL_dalpha: FloatArray | None = None,
        dL_dfeatures: FloatArray | None = None,
        statistics: bool = False,
    ) -> Gradients:
        """Compute the gradients of the last `forward`; its map must be unchanged since.

        Args:
            dL_drgb: [H,W,3] gradient of the loss with respect to `Images.rgb`, of this
                rasterizer's dtype; None, here and below, if the loss does not depend on the image.
            dL_ddepth: [H,W].
            dL_dalpha: [H,W].
            dL_dfeatures: [H,W,D].
            statistics: Also fill abs_dL_dmeans2d, max_weights and pixel_counts.

        Raises:
            RuntimeError: There was no `forward`.
            ValueError: An array has a wrong shape or dtype or holds a number that is not finite.
        """
        if self._view is None:
            raise RuntimeError("Rasterizer.backward: there was no forward")
        gradients = self._core.backward(
            self._view,
            dL_drgb=_contiguous(dL_drgb),
            dL_ddepth=_contiguous(dL_ddepth),
            dL_dalpha=_contiguous(dL_dalpha),
            dL_dfeatures=_contiguous(dL_dfeatures),
            statistics=statistics,
        )
        return Gradients(**gradients)

    def lift(self, features: FloatArray) -> LiftedFeatures:
        """Back-project a feature image from the camera of the last `forward` to the Gaussians.

        This is the transpose of rendering features; the map needs no features.

        Args:
            features: S [H,W,D] of this rasterizer's dtype; pixels outside the mask of the forward
                do not count and may hold anything.

        Raises:
            RuntimeError: There was no `forward`.
            ValueError: The array has a wrong shape or dtype, or a number inside the mask is not
                finite.
        """
        if self._view is None:
            raise RuntimeError("Rasterizer.lift: there was no forward")
        return LiftedFeatures(*self._core.lift(self._view, _contiguous(features)))


def render(
    gaussian_map: GaussianMap,
    camera: Camera,
    options: RenderOptions | None = None,
    *,
    mask: Bools | None = None,
) -> Images:
    """Render a map once; see `Rasterizer.forward`.

    Args:
        gaussian_map: float32 or float64.
        camera: Camera at world_from_camera.
        options: Options; None means `RenderOptions()`.
        mask: [H,W] pixels to render; None means all.

    Raises:
        ValueError: The mask has the wrong shape or dtype, or an option is out of range.
    """
    return Rasterizer(gaussian_map.dtype).forward(gaussian_map, camera, options, mask=mask)


def rows_in_view(
    gaussian_map: GaussianMap, cameras: Iterable[Camera], options: RenderOptions | None = None
) -> Indices:
    """Return all Gaussians that renderings may show, and others: whole chunks that may be in view.

    Args:
        gaussian_map: Any map.
        cameras: Cameras of the renderings.
        options: Options of the renderings; None means `RenderOptions()`.

    Returns:
        [M] rows, ascending; all rows of a small map.

    Raises:
        ValueError: An option is out of range.
    """
    view: Any = gaussian_map.view(whole=False)
    options = RenderOptions() if options is None else options
    chunks = [chunks_in_view(view, camera, options) for camera in cameras]
    return gaussian_map.rows_of_chunks(np.unique(np.concatenate([np.zeros(0, np.uint32), *chunks])))


def scatter_rows(rows: UInts32, values: NDArray[Any], size: int) -> NDArray[Any]:
    """Return zeros [size,...] with values at some rows.

    Args:
        rows: [V] ascending.
        values: [V,...].
        size: Number of rows of the result.
    """
    table = _contiguous(values.reshape(len(rows), prod(values.shape[1:])))
    return _SCATTER_ROWS[values.dtype](rows, table, size).reshape(size, *values.shape[1:])


def _contiguous(array: Any) -> Any:
    """Copy an array that is not C-contiguous and aligned; the core checks all else."""
    return None if array is None else np.require(array, requirements=["C", "ALIGNED"])
