"""Part of a large map that an update may read or change."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from gslts.core.camera import Camera, downscale
from gslts.core.gaussian_map import GaussianMap
from gslts.rendering.rasterizer import Rasterizer, RenderOptions
from gslts.rendering.view_range import view_range_m
from gslts.types import Bools, Indices
from gslts.update.config import UpdateConfig
from gslts.update.region import Region
from gslts.update.targets import region_mask
from gslts.update.views import View, largest_range_m

DIVISOR = 4
"""Images are rendered at 1 / 4 of their width to find what they show: a Gaussian covers at least
a pixel of any size, so that none is missed."""
BORDER_PX = 4
"""Border around these images, px: their cameras are aligned again with the edited map."""


def rows_of_update(
    gaussian_map: GaussianMap,
    cameras: Sequence[Camera],
    views: Sequence[View],
    regions: Sequence[Region],
    config: UpdateConfig,
) -> Indices:
    """Return the Gaussians that an update may read or change.

    Those that may be seen in the views, in the training images around a change, or are near it.

    Args:
        gaussian_map: float32.
        cameras: Training cameras of the map.
        views: Collected views.
        regions: Regions of the changes.
        config: Settings.

    Returns:
        [M] rows, ascending; all rows of a small map.
    """
    if gaussian_map.bounds is None:
        return np.arange(gaussian_map.size)
    needed = np.zeros(gaussian_map.size, np.bool_)
    for region in regions:
        near = region.expand(config.refine.reach_m)
        needed[gaussian_map.rows_in_box(near.low, near.high)] = True
    rasterizer, plain = Rasterizer(np.float32), gaussian_map.without_features()
    for camera, range_m, mask in _images(cameras, views, regions, config.refine.margin_px):
        options = RenderOptions(far_m=range_m, threads=config.threads)
        images = rasterizer.forward(plain, camera, options, mask=mask)
        needed[rasterizer.backward(dL_dalpha=np.zeros_like(images.alpha)).rows] = True
    return np.flatnonzero(needed)


def _images(
    cameras: Sequence[Camera], views: Sequence[View], regions: Sequence[Region], margin_px: int
) -> Iterator[tuple[Camera, float, Bools | None]]:
    """Yield the small images that the part must show: camera, far plane, m, and wanted pixels."""
    for view in views:
        yield _widen(downscale(view.camera, DIVISOR)), view_range_m(view.depth), None
    range_m = largest_range_m(views)
    for camera in cameras:
        small = downscale(camera, DIVISOR)
        mask = region_mask(small, regions, margin_px // DIVISOR + 1)
        if mask.any():
            yield small, range_m, mask


def _widen(camera: Camera) -> Camera:
    """Return a camera with a border around its image."""
    return Camera(
        fx=camera.fx,
        fy=camera.fy,
        cx=camera.cx + BORDER_PX,
        cy=camera.cy + BORDER_PX,
        width=camera.width + 2 * BORDER_PX,
        height=camera.height + 2 * BORDER_PX,
        world_from_camera=camera.world_from_camera,
    )
